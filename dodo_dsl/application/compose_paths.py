"""Paths in compose files, which are relative to the file's folder, as seen from another folder."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl import source
from dodo_dsl.source import Entry, Node, Scalar

Change = Callable[[str], str]

_REMOTE = ("/", "~", "$", "git@", "github.com/", "service:", "target:")


def rebased(path: str, base: str) -> str:
    """A path as seen from another folder, from which ``base`` is the path's own; absolute paths and URLs stay."""
    if (path.startswith(_REMOTE) and not path.startswith("$$")) or "://" in path:
        return path
    joined = os.path.normpath(f"{base}/{path}")
    return joined if joined.startswith((".", "/")) else f"./{joined}"


def escaped(text: str) -> str:
    """A path as a compose file has it, in which a dollar sign alone begins a variable."""
    return text.replace("$", "$$")


def escaped_values(value: Any) -> Any:
    """Values of JSON with all their texts escaped."""
    return mapped_texts(value, escaped)


def unescaped(value: Any) -> Any:
    """What ``docker compose config`` shows, which escapes all texts, as they are."""
    return mapped_texts(value, lambda text: text.replace("$$", "$"))


def mapped_texts(value: Any, change: Change) -> Any:
    """Values of JSON with ``change`` applied to each text."""
    if isinstance(value, dict):
        return {key: mapped_texts(each, change) for key, each in value.items()}
    if isinstance(value, list):
        return [mapped_texts(each, change) for each in value]
    return change(value) if isinstance(value, str) else value


def is_path(text: str) -> bool:
    """Whether a volume's source is a path; other words name a volume."""
    return text.startswith((".", "/", "~"))


def is_local(context: str) -> bool:
    """Whether what is built is a folder, and not known to be elsewhere."""
    return "://" not in context and not context.startswith(_REMOTE)


def mapped_service(service: source.Mapping, change: Change) -> source.Mapping:
    """A service with ``change`` applied to each of its paths."""
    return _mapped(service, _SERVICE, change)


def mapped_rest(rest: Mapping[str, Node], change: Change) -> dict[str, Node]:
    """Top-level volumes, secrets and configs likewise."""
    return {key: _each(node, _TOP[key], change) if key in _TOP else node for key, node in rest.items()}


Form = Callable[[Node, Change], Node]


def _mapped(node: Node, table: Mapping[str, Form], change: Change) -> source.Mapping:
    assert isinstance(node, source.Mapping)
    entries = {k: Entry(e.key, table[k](e.value, change)) if k in table else e for k, e in node.entries.items()}
    return replace(node, entries=entries)


def _fields(**table: Form) -> Form:
    return lambda node, change: _mapped(node, table, change) if isinstance(node, source.Mapping) else node


def _path(node: Node, change: Change) -> Node:
    if not isinstance(node, Scalar) or not isinstance(node.value, str):
        return node
    text = change(node.value)
    return replace(node, value=text, text=text)


def _each(node: Node, form: Form, change: Change) -> Node:
    if isinstance(node, source.Sequence):
        return replace(node, items=tuple(form(item, change) for item in node.items))
    if isinstance(node, source.Mapping):
        return replace(node, entries={k: Entry(e.key, form(e.value, change)) for k, e in node.entries.items()})
    return node


def _build(node: Node, change: Change) -> Node:
    if not isinstance(node, source.Mapping):
        return _path(node, change)
    if "context" not in node.entries:
        here = Entry(node.span, Scalar(node.span, ".", "."))
        node = replace(node, entries={"context": here, **node.entries})
    return _mapped(node, {"context": _path, "additional_contexts": _contexts}, change)


def _contexts(node: Node, change: Change) -> Node:
    def after_sign(text: str) -> str:
        name, sign, path = text.partition("=")
        return name + sign + change(path)

    return _each(node, _path, change if isinstance(node, source.Mapping) else after_sign)


def _env_file(node: Node, change: Change) -> Node:
    if isinstance(node, source.Sequence):
        return _each(node, _env_file, change)
    return _fields(path=_path)(node, change) if isinstance(node, source.Mapping) else _path(node, change)


def _volume(node: Node, change: Change) -> Node:
    if isinstance(node, source.Mapping):
        kind = node.get("type")
        is_bind = isinstance(kind, Scalar) and kind.value == "bind"
        return _fields(source=_path)(node, change) if is_bind else node

    def of_short(text: str) -> str:
        origin, sign, rest = text.partition(":")
        return f"{change(origin)}{sign}{rest}" if sign and is_path(origin) else text

    return _path(node, of_short)


def _named_volume(node: Node, change: Change) -> Node:
    options = node.get("driver_opts") if isinstance(node, source.Mapping) else None
    flags = options.get("o") if isinstance(options, source.Mapping) else None
    if not isinstance(flags, Scalar) or "bind" not in flags.text:
        return node
    return _fields(driver_opts=_fields(device=_path))(node, change)


_SERVICE: dict[str, Form] = {
    "build": _build,
    "env_file": _env_file,
    "volumes": lambda node, change: _each(node, _volume, change),
}
_TOP: dict[str, Form] = {"secrets": _fields(file=_path), "configs": _fields(file=_path), "volumes": _named_volume}
