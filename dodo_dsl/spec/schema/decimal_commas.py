"""Decimal commas in ``{z: 9,5 cm}``, which YAML reads as ``z: 9`` and an empty key ``5 cm``."""

import re

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Entry, Mapping, Node, Scalar

_WHOLE = re.compile(r"[-+]?[0-9]{1,20}")
_REST = re.compile(r"[0-9]{1,20}( ?[A-Za-z%][^ ]{0,10})?")


def joined(node: Node) -> Node:
    """The node with such values joined, as their author meant them."""
    if not isinstance(node, Mapping):
        return node
    entries: dict[str, Entry] = {}
    last = ""
    for key, entry in node.entries.items():
        before = entries[last].value if last else None
        if isinstance(before, Scalar) and _continues(before, key, entry):
            text = f"{before.text},{key}"
            place = before.span
            whole = Span(place.file, place.line, place.column, len(text))
            entries[last] = Entry(entries[last].key, Scalar(whole, text, text))
        else:
            entries[key] = Entry(entry.key, joined(entry.value))
            last = key
    return Mapping(node.span, entries, node.tag)


def _continues(before: Scalar, key: str, entry: Entry) -> bool:
    """Whether a key without a value directly follows the comma of a number."""
    empty = isinstance(entry.value, Scalar) and entry.value.value is None and not entry.value.text
    place = (before.span.line, before.span.column + len(before.text) + 1)
    adjacent = (entry.key.line, entry.key.column) == place
    return empty and adjacent and bool(_WHOLE.fullmatch(before.text) and _REST.fullmatch(key))
