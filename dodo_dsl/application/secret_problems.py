"""Warnings of variables that look like secrets, and so are unset in a test or stay out of its files."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from dodo_dsl import source
from dodo_dsl.application import interpolation, secret_variables
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node, Scalar

_NAMED = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_LISTS = ("environment", "args")
_OF_FOLDER = ("PWD", "PATH")
"""What compose sets itself."""


def withheld(
    nodes: Collection[Node], texts: Mapping[Span, str], known: Collection[str], outside: Mapping[str, str]
) -> Iterator[Diagnostic]:
    """Variables that the files name and that a test does not get, though they are in DoDo's environment ``outside``.

    ``texts`` are the values with variables as they are written, by their places.
    """
    seen = {*known, *_OF_FOLDER}
    for node in nodes:
        for name, span in _named(node, "", texts):
            is_secret = secret_variables.holds_secret(name, outside.get(name, ""))
            if not (is_secret or name in outside) or name in seen or name.startswith("DODO_IMAGE_"):
                continue
            seen.add(name)
            why = "looks like a secret" if is_secret else "is of DoDo's own environment"
            message = f"variable '{name}' {why}, so it is unset in a test"
            hint = f"to pass it, write environment: [{name}] in dodo.yml"
            yield Diagnostic(span, "application-secret", message, hint, "warning")


def written(nodes: Collection[Node]) -> Iterator[Diagnostic]:
    """Values in tests that look like secrets; each once, though anchors and merges repeat it."""
    seen: set[Span] = set()
    for node in nodes:
        for part in source.walk(node):
            kind = secret_variables.secret_kind(part.text) if isinstance(part, Scalar) else ""
            if kind and part.span not in seen:
                seen.add(part.span)
                message = f"this looks like {kind}, which everybody with access to the repository can read"
                hint = "keep it out of the repository, and pass a variable with 'environment' of dodo.yml"
                yield Diagnostic(replace(part.span, length=0), "application-secret", message, hint, "warning")


def _named(node: Node, key: str, texts: Mapping[Span, str]) -> Iterator[tuple[str, Span]]:
    """The variables that a node takes from outside, each with its place; ``key`` is the node's own."""
    if isinstance(node, source.Mapping):
        for word, entry in node.entries.items():
            is_empty = isinstance(entry.value, Scalar) and entry.value.value is None
            if key in _LISTS and is_empty:
                yield word, entry.key
            if not word.startswith("x-"):
                yield from _named(entry.value, word, texts)
    elif isinstance(node, source.Sequence):
        for item in node.items:
            if key in _LISTS and isinstance(item, Scalar) and _NAMED.fullmatch(item.text):
                yield item.text, item.span
            yield from _named(item, "", texts)
    else:
        yield from ((name, node.span) for name in sorted(interpolation.names(texts.get(node.span, ""))))
        if key == "environment" and isinstance(node.value, str):
            yield node.text, node.span
