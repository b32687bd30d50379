"""What keys and values mean that are almost right: units, minus signs, decimal commas, missing spaces, indentation."""

import math
import re
from collections.abc import Callable, Collection, Iterator
from typing import Any

import yaml

from dodo_dsl.diagnostics import Diagnostic, Fix, closest, did_you_mean, only_fix
from dodo_dsl.source import Entry, Mapping, Node, Scalar

_ALIASES = {
    "°": "deg",
    "°/s": "deg/s",
    "µs": "us",
    "sec": "s",
    "m/s²": "m/s2",
    "m/s^2": "m/s2",
    "rad/s²": "rad/s2",
    "rad/s^2": "rad/s2",
    "deg/s²": "deg/s2",
    "deg/s^2": "deg/s2",
}
_WORDS = {"yes": "true", "y": "true", "on": "true", "no": "false", "n": "false", "off": "false"}
_MINUS = "\u2212\u2010\u2011\u2012\u2013\u2014"
_REST = re.compile(r"[0-9]{1,20}( ?[A-Za-z%][^ ]{0,10})?")
"""What stands behind a decimal comma, which in braces begins another key."""
_CLOSING = {"{": "}", "[": "]"}


def repaired(text: str, fits: Callable[[str], bool]) -> tuple[str, Fix | None]:
    """A hint how to write a value so that it ``fits``, and the only fix; empty and None if nothing does."""
    before = text.partition("#")[0]
    if before != text and fits(before.strip()):
        return "a comment begins with ' #', after a space", Fix("#", " #")
    bare = text.rstrip(",; ")
    if bare != text and fits(bare):
        return f"write '{bare}', without '{text[len(bare) :].strip()}'", Fix(text, bare)
    hyphen = f"-{text[1:]}"
    if text[:1] in _MINUS and text and fits(hyphen):
        return f"write '{hyphen}', with a hyphen for the minus sign", Fix(text, hyphen)
    return "", None


def unit_meant(written: str, text: str, units: Collection[str]) -> Fix | None:
    """The only unit of some that one of a ``text`` means: in other letters, or as it is written elsewhere."""
    meant = {unit for unit in units if unit.lower() == written.lower() or unit == _ALIASES.get(written)}
    if len(meant) != 1:
        return None
    unit = meant.pop()
    return Fix(written, unit if f" {written}" in text else f" {unit}")


def boolean_meant(text: str) -> tuple[str, Fix | None]:
    """A hint for a word that other readers of YAML take for true or false, and the fix; empty and None for others."""
    meant = _WORDS.get(text.lower(), "")
    return (f"write {meant}", Fix(text, meant)) if meant else ("", None)


_MISSING = (
    (re.compile(r"(?P<key>[^:\s]+):(?P<value>.*\S.*)", re.DOTALL), "a space is missing after the colon of '{}'"),
    (re.compile(r"(?P<key>[^\s=]+)[\s=]+(?P<value>.+)", re.DOTALL), "a colon is missing after '{}'"),
)
"""Keys in text that is YAML nonetheless, as ``{uses:camera}`` is; the second has no value."""


def unknown_key(
    word: str, known: Collection[str], beside: Collection[str] = (), *, is_empty: bool
) -> tuple[str, str, Fix | None]:
    """What is wrong with an unknown key beside others, empty for a misspelt one, a hint, and the only fix."""
    for number, (pattern, message) in enumerate(_MISSING[: 1 + is_empty]):
        if (found := pattern.fullmatch(word)) and found["key"] in known:
            key, value = found["key"], found["value"].strip()
            fix = None if number else Fix(word, f"{key}: {value}")
            return message.format(key), _write(key, value), fix
    if is_empty and _REST.fullmatch(word):
        return "", f"a comma separates keys: write a number as 0.{word}, with a point", None
    return "", did_you_mean(word, known), only_fix(word, known, beside)


def meant(word: str, known: Collection[str], *, is_empty: bool) -> str:
    """The known key that an unknown one most likely means; empty when there is none."""
    found = (match["key"] for pattern, _ in _MISSING[: 1 + is_empty] if (match := pattern.fullmatch(word)))
    return next((key for key in found if key in known), "") or next(iter(closest(word, known)), "")


def _write(key: str, value: str) -> str:
    closing = _CLOSING.get(value[0], "")
    if closing not in value:  # the key ends at the first colon within the brackets
        value = f"{value[0]}...{closing}"
    return f"write '{key}: {value if len(value) <= 60 else f'{value[:57]}...'}'"


def in_line(value: object) -> str:
    """YAML in one line."""
    text = str(yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=math.inf))
    return text.strip().removesuffix("\n...")


def to_write(key: str, schema: dict[str, Any]) -> str:
    """A hint for a key that is missing: ``write 'kind: closed-loop'``."""
    first = (schema.get("examples") or schema.get("enum") or [schema.get("const")])[0]
    others = [in_line(other) for other in schema.get("enum", ()) if other != first]
    more = f", or {', '.join(others)}" if others else ""
    return f"write '{key}: {in_line(first)}'{more}" if first is not None else ""


def mended(node: Node, schema: dict[str, Any]) -> tuple[Node, list[Diagnostic]]:
    """The node as it is meant, and what is said about keys that are indented one level too little or too much.

    The schema has no references.
    """
    found: list[Diagnostic] = []
    return _indented(node, schema, found), found


def _indented(node: Node, schema: dict[str, Any], found: list[Diagnostic]) -> Node:
    if not isinstance(node, Mapping):
        return node
    written = dict(_raised(node, schema, found))
    entries: dict[str, Entry] = {}
    home, reported = "", ""
    for key, entry in written.items():
        above = entries.get(home)
        if above and _is_stray(key, entry, above, schema, schema_at(schema, home)):
            own = _children(above.value)
            if reported != home:
                deep = next((e.key.column for e in own.values() if e.key.line > above.key.line), entry.key.column + 2)
                message = f"'{key}' stands beside '{home}'; {_place(deep)}"
                found.append(Diagnostic(entry.key, "unknown-key", message, f"it belongs to '{home}'"))
            entries[home] = Entry(above.key, Mapping(above.value.span, {**own, key: entry}, above.value.tag))
            reported = home
        else:
            entries[key], home = entry, key
    below = {
        key: Entry(entry.key, _indented(entry.value, schema_at(schema, key), found)) for key, entry in entries.items()
    }
    return Mapping(node.span, below, node.tag)


def _place(column: int) -> str:
    return f"indent it by {column - 1} spaces" if column > 1 else "begin it in the first column"


def _raised(node: Mapping, schema: dict[str, Any], found: list[Diagnostic]) -> Iterator[tuple[str, Entry]]:
    """The entries, and those of this mapping's own keys that stand in one of them, which has no such key."""
    known = schema.get("properties", {})
    for key, entry in node.entries.items():
        home = schema_at(schema, key)
        deep = {}
        for name, inner in _children(entry.value).items():
            is_known = name in known and known[name].get("type") == "object"
            is_free = is_known and name not in node.entries and inner.key.line > entry.key.line
            if is_free and isinstance(inner.value, Mapping) and not _takes(home, name, inner.value):
                deep[name] = inner
                message = f"'{name}' stands below '{key}'; {_place(entry.key.column)}"
                found.append(Diagnostic(inner.key, "unknown-key", message, f"it belongs beside '{key}'"))
        if deep:
            rest = {name: inner for name, inner in _children(entry.value).items() if name not in deep}
            entry = Entry(entry.key, Mapping(entry.value.span, rest, entry.value.tag))  # noqa: PLW2901
        yield key, entry
        yield from deep.items()


def _takes(schema: dict[str, Any], key: str, value: Node) -> bool:
    """Whether a mapping with this schema may have the key, with a value such as this one."""
    own, more = schema.get("properties", {}), schema.get("additionalProperties", True)
    if "object" not in schema.get("type", "object"):
        return False
    if key in own or more is True:
        is_mapping = own.get(key, {}).get("type", "object") == "object" and "enum" not in own.get(key, {})
        return is_mapping or not isinstance(value, Mapping)
    inner = (more if isinstance(more, dict) else {}).get("properties", {})
    return more is not False and not inner.keys().isdisjoint(_children(value))


def schema_at(schema: dict[str, Any], key: str) -> dict[str, Any]:
    """The schema of the value at a key."""
    found = schema.get("properties", {}).get(key) or schema.get("additionalProperties")
    return found if isinstance(found, dict) else {}


def _children(node: Node) -> dict[str, Entry]:
    return node.entries if isinstance(node, Mapping) else {}


def _is_stray(key: str, entry: Entry, above: Entry, schema: dict[str, Any], home: dict[str, Any]) -> bool:
    """Whether a key belongs into the mapping above, which begins in its own column."""
    is_empty = isinstance(above.value, Scalar) and above.value.value is None and not above.value.text
    if not (is_empty or isinstance(above.value, Mapping)) or key in _children(above.value):
        return False
    if entry.key.line == above.key.line or (entry.key.column, entry.key.file) != (above.key.column, above.key.file):
        return False
    if _takes(schema, key, entry.value) or not _takes(home, key, entry.value):
        return False
    is_any = home.get("additionalProperties", True) is True
    return not is_any or not closest(key, schema.get("properties", {}))
