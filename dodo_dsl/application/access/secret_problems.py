"""Warnings of variables that look like secrets, and so are unset in a test or stay out of its files."""

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application import interpolation
from dodo_dsl.application.access import secret_variables
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node, Scalar

_NAMED = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_LISTS = ("environment", "args")


def withheld(nodes: Collection[Node], own: Collection[str], passed: Collection[str]) -> Iterator[Diagnostic]:
    """Variables of DoDo's own environment that the files name; ``own`` are the application's."""
    seen: set[str] = set()
    for node in nodes:
        for name, span in _named(node, ""):
            if not secret_variables.is_secret(name) or name in {*seen, *own, *passed}:
                continue
            seen.add(name)
            message = f"variable '{name}' looks like a secret, so it is unset in a test"
            hint = f"to pass it, write environment: [{name}] in dodo.yml"
            yield Diagnostic(span, "application-secret", message, hint, "warning")


def _named(node: Node, key: str) -> Iterator[tuple[str, Span]]:
    """The variables that a node takes from outside, each with its place; ``key`` is the node's own."""
    if isinstance(node, source.Mapping):
        for word, entry in node.entries.items():
            is_empty = isinstance(entry.value, Scalar) and entry.value.value is None
            if key in _LISTS and is_empty:
                yield word, entry.key
            if not word.startswith("x-"):
                yield from _named(entry.value, word)
    elif isinstance(node, source.Sequence):
        for item in node.items:
            if key in _LISTS and isinstance(item, Scalar) and _NAMED.fullmatch(item.text):
                yield item.text, item.span
            yield from _named(item, "")
    else:
        yield from ((name, node.span) for name in sorted(interpolation.names(node.text)))
        if key == "environment" and isinstance(node.value, str):
            yield node.text, node.span


def left_out(secrets: Mapping[str, Path]) -> Iterator[Diagnostic]:
    """Secrets of the application's ``.env`` files, which are not copied into compiled tests."""
    for file in dict.fromkeys(secrets.values()):
        names = [name for name, of in secrets.items() if of == file]
        listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        message = f"secrets stay out of compiled tests: {listed}"
        hint = "'dodo run' takes them from this file, where it is there, or from variables that dodo.yml passes"
        yield Diagnostic(_place(file, names[0]), "application-secret", message, hint, "warning")


def _place(file: Path, name: str) -> Span:
    """Where a variable is set; the line itself is not to be shown."""
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    found = re.compile(rf"\s*(?:export\s+)?(?P<name>{re.escape(name)})\s*[=:]")
    for number, line in enumerate(lines, 1):
        if match := found.match(line):
            return Span(str(file), number, match.start("name") + 1, 0)
    return Span(str(file), 1, 1, 0)
