"""Recordings as files of other tools."""
