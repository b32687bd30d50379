"""Texts of compose files by the keys below which they stand: variables, and paths relative to a file's folder."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl import source
from dodo_dsl.application.interpolation import filled
from dodo_dsl.source import Entry, Node, Scalar

Place = tuple[str, ...]
Change = Callable[[Scalar, Place], str]

_REMOTE = ("/", "~", "$", "git@", "github.com/", "service:", "target:")


def changed(node: Node, change: Change, place: Place = ()) -> Node:
    """A node with each text changed, by the keys that lead to it; every part keeps its place."""
    if isinstance(node, source.Mapping):
        entries = {k: Entry(e.key, changed(e.value, change, (*place, k))) for k, e in node.entries.items()}
        return replace(node, entries=entries)
    if isinstance(node, source.Sequence):
        return replace(node, items=tuple(changed(item, change, place) for item in node.items))
    if not isinstance(node.value, str):
        return node
    text = change(node, place)
    return node if text == node.value else replace(node, value=text, text=text)


def filled_node(node: Node, known: Mapping[str, str], late: Callable[[str], bool]) -> Node:
    """A node with its variables filled in."""
    return changed(node, lambda word, *_: filled(str(word.value), known, late))


def relocated(document: source.Mapping, base: str) -> Node:
    """A file in normal form with its paths as seen from the folder from which ``base`` leads to its own."""

    def moved(word: Scalar, place: Place) -> str:
        text, key = str(word.value), (place[0], *place[2:]) if place else ()
        is_mount = key == ("services", "volumes", "source") and is_path(text)
        return rebased(text, base) if key in _PATHS or key[:3] == _CONTEXTS or is_mount else text

    return changed(document, moved)


_PATHS = {("services", "build", "context"), ("services", "env_file", "path"), ("secrets", "file"), ("configs", "file")}
_CONTEXTS = ("services", "build", "additional_contexts")


def rebased(path: str, base: str) -> str:
    """A path as seen from another folder, from which ``base`` is the path's own; absolute paths and URLs stay."""
    if (path.startswith(_REMOTE) and not path.startswith("$$")) or "://" in path:
        return path
    joined = os.path.normpath(f"{base}/{path}")
    return joined if joined.startswith((".", "/")) else f"./{joined}"


def escaped(text: str) -> str:
    """A path as a compose file has it, in which a dollar sign alone begins a variable."""
    return text.replace("$", "$$")


def mapped_texts(value: Any, change: Callable[[str], str]) -> Any:
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
