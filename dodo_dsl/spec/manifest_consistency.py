"""``wrong-manifest``: what concerns two places of a manifest, so that its schema cannot express it.

``manifest-name``: the service and its folder have the same name.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.source import Mapping, Node, Scalar, plain, walk

RULE = "wrong-manifest"
RESERVED = ("cid", "help")

_PLACEHOLDER = re.compile(r"\{(?P<name>[^{}]*)\}")
_NUMBERS = ("number", "integer")
_TEXTS = ("string", "memory", "message", "output")
_DEFAULTS: dict[str, tuple[type, ...]] = {
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "list": (list,),
    **dict.fromkeys(_TEXTS, (str,)),
}


def problems(node: Mapping) -> Iterator[Diagnostic]:
    """Problems of ports, defaults, bounds and references in a manifest that its schema accepts."""
    parameters = node.get("parameters")
    entries = parameters.entries if isinstance(parameters, Mapping) else {}
    types = {name: str(plain(entry.value)["type"]) for name, entry in entries.items()}
    for key in ("messages", "memory", "devices"):
        written = node.get(key)
        if written is not None:
            yield from _ports(written, types)
    groups = node.get("one-of")
    for scalar in walk(groups) if groups is not None else ():
        if isinstance(scalar, Scalar) and scalar.text not in types:
            message = f"'one-of' names the unknown parameter '{scalar.text}'"
            yield Diagnostic(scalar.span, RULE, message, did_you_mean(scalar.text, types))
    for name, entry in entries.items():
        if name in RESERVED:
            message = f"'--{name}' is a flag of every service, so it cannot name a parameter"
            yield Diagnostic(entry.key, RULE, message, "choose another name")
        if isinstance(entry.value, Mapping):
            yield from _parameter(name, entry.value, types)


def name_problems(name: str, path: Path) -> Iterator[Diagnostic]:
    """A warning where the service of a manifest has another name than its folder; ``my-name`` may be in ``my_name``."""
    folder = path.parent.name
    if folder.replace("_", "-") != name.replace("_", "-"):
        message = f"the service is named '{name}', and its folder '{folder}'"
        hint = f"tests use the name: 'uses: {name}'; give both the same"
        yield Diagnostic(Span(str(path)), "manifest-name", message, hint, severity="warning")


def _ports(node: Node, types: dict[str, str]) -> Iterator[Diagnostic]:
    for scalar in walk(node):
        if not isinstance(scalar, Scalar):
            continue
        for match in _PLACEHOLDER.finditer(scalar.text):
            if match["name"] not in types:
                message = f"'{scalar.text}' names the unknown parameter '{match['name']}'"
                yield Diagnostic(scalar.span, RULE, message, did_you_mean(match["name"], types))


def _parameter(name: str, node: Mapping, types: dict[str, str]) -> Iterator[Diagnostic]:
    raw = plain(node)
    kind = raw["type"]
    for key, kinds in (("unit", ("number",)), ("minimum", _NUMBERS), ("maximum", _NUMBERS)):
        if key in raw and kind not in kinds:
            yield _misplaced(node, key, f"'{key}' is for numbers, but '{name}' is of type {kind}")
    if "choices" in raw and kind not in ("string", "list"):
        yield _misplaced(node, "choices", f"'choices' are for strings and lists, but '{name}' is of type {kind}")
    for key in ("within-timeout", "setup-times"):
        if raw.get(key) and raw.get("unit") != "s":
            yield _misplaced(node, key, f"'{name}' is not a duration", "add 'unit: s'")
    if raw.get("minimum", 0) > raw.get("maximum", raw.get("minimum", 0)):
        yield _misplaced(node, "minimum", f"the minimum of '{name}' is larger than its maximum")
    for key in ("not-empty", "format"):
        if key in raw and kind != "path":
            yield _misplaced(node, key, f"'{key}' is for paths, but '{name}' is of type {kind}")
    source = str(raw.get("among", "")).partition(".")[0]
    if source and types.get(source) != "path":
        message = f"'among' begins with '{source}', expected a parameter of type path"
        yield _misplaced(node, "among", message, did_you_mean(source, [n for n, t in types.items() if t == "path"]))
    yield from _default(name, node, raw)


def _default(name: str, node: Mapping, raw: dict[str, Any]) -> Iterator[Diagnostic]:
    if "default" not in raw:
        return
    kind, default = raw["type"], raw["default"]
    if kind == "path":
        yield _misplaced(node, "default", f"'{name}' is a path in a test, so it cannot have a default")
        return
    if not isinstance(default, _DEFAULTS[kind]) or (isinstance(default, bool) and kind != "boolean"):
        yield _misplaced(node, "default", f"the default of '{name}' is not of type {kind}")
    elif kind in _NUMBERS and not raw.get("minimum", default) <= default <= raw.get("maximum", default):
        yield _misplaced(node, "default", f"the default of '{name}' is not between its minimum and its maximum")
    elif kind == "string" and default not in raw.get("choices", [default]):
        yield _misplaced(node, "default", f"the default of '{name}' is not one of its choices")


def _misplaced(node: Mapping, key: str, message: str, hint: str = "") -> Diagnostic:
    span: Span = node.entries[key].key
    return Diagnostic(span, RULE, message, hint)
