"""Compose files with their variables filled in, as far as the values are known."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl import source
from dodo_dsl.application.access import secret_variables
from dodo_dsl.application.interpolation import EnvironmentProblem, interpolate
from dodo_dsl.source import Entry, Node


def known_variables(
    own: Mapping[str, str], outside: Mapping[str, str], folder: str, passed: Collection[str] = ()
) -> dict[str, str]:
    """The variables that compose would fill in: those ``outside`` first, then those of the application's ``.env``."""
    found: dict[str, str] = {}
    seen = {**secret_variables.allowed(outside, passed), "PWD": folder}
    for name, value in own.items():
        found[name] = text(value, {**found, **seen})
    return {**found, **seen}


def text(written: str, known: Mapping[str, str]) -> str:
    """A string with its variables filled in; as it is when one of them is neither known nor has a default."""
    if "$" not in written:
        return written
    try:
        return interpolate(written, known, unset=False)
    except EnvironmentProblem:
        return written


def value(written: Any, known: Mapping[str, str]) -> Any:
    """The same for a plain value with whatever it holds."""
    if isinstance(written, dict):
        return {key: value(below, known) for key, below in written.items()}
    if isinstance(written, list):
        return [value(item, known) for item in written]
    return text(written, known) if isinstance(written, str) else written


def node(written: Node, known: Mapping[str, str]) -> Node:
    """The same for a node; every part keeps its place."""
    return changed(written, lambda word: text(word, known))


def changed(written: Node, change: Callable[[str], str]) -> Node:
    """A node with ``change`` applied to each text that has a variable; every part keeps its place."""
    if isinstance(written, source.Mapping):
        entries = {key: Entry(entry.key, changed(entry.value, change)) for key, entry in written.entries.items()}
        return replace(written, entries=entries)
    if isinstance(written, source.Sequence):
        return replace(written, items=tuple(changed(item, change) for item in written.items))
    if not isinstance(written.value, str) or "$" not in written.value:
        return written
    filled = change(written.value)
    return replace(written, value=filled, text=filled)
