"""Nodes from YAML, for tests of what reads them."""

from dodo_dsl import source


def mapping(text: str, file: str = "x.yml") -> source.Mapping:
    """The mapping of a YAML document without problems."""
    node, problems = source.parse(text, file)
    assert isinstance(node, source.Mapping)
    assert problems == []
    return node


def value(text: str) -> source.Node:
    """The node of a single value."""
    return mapping(f"key: {text}\n").entries["key"].value
