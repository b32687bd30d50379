"""Instances of a spec: values of ``matrix`` and ``vary`` for their placeholders."""
