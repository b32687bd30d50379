"""Leaves out what only follows from another problem, so that each mistake is reported once."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.model import LAYERS

_VALUE = frozenset({"matrix-unknown", "vary-unknown", "yaml-tag"})
"""Rules about a value as it is written, of which nothing else can be said."""
_OF_BASE = frozenset({"no-limit", "service-taken"})
"""Rules about a service that is merged with one of an extended test."""
_UNFILLED = re.compile(r"'[^']*\$\{(matrix|vary)\.[a-z][a-z0-9-]*\}[^']*'")
"""A value in a message whose dimension or range is wrong itself, so that nothing has replaced the placeholder."""


def without_consequences(
    found: Iterable[Diagnostic], by_rules: Mapping[Path, Sequence[Diagnostic]]
) -> Iterator[Diagnostic]:
    """The problems without those that follow from others; ``by_rules`` are those of each test."""
    everything = list(found)
    told = {_place(d) for d in everything if d.rule in _VALUE}
    moved = {path: layers for path, problems in by_rules.items() if (layers := set(_meant(problems)))}
    gone = {d for path in moved for d in _of_services(path, by_rules[path])}
    wrong = {d.span.file for d in everything if d.severity == "error" and not _UNFILLED.search(d.message)}
    lacking = {(str(path), f"the file has no key '{layer}'") for path, layers in moved.items() for layer in layers}
    for d in everything:
        unfilled = d.span.file in wrong and _UNFILLED.search(d.message)
        follows = d.rule not in _VALUE and (_place(d) in told or unfilled)
        if not follows and d not in gone and (d.span.file, d.message) not in lacking:
            yield d


def _place(diagnostic: Diagnostic) -> tuple[str, int, int]:
    return diagnostic.span.file, diagnostic.span.line, diagnostic.span.column


def _meant(problems: Iterable[Diagnostic]) -> Iterator[str]:
    """The layers that services belong into which are in another one."""
    for d in problems:
        if d.rule == "wrong-layer":
            yield from (layer for layer in LAYERS if re.search(rf"\b{layer}\b", d.hint))


def _of_services(path: Path, problems: Sequence[Diagnostic]) -> Iterator[Diagnostic]:
    """What a test says twice or too little, as an extended one has a service in the wrong layer."""
    if any(d.rule == "wrong-layer" and d.span.file != str(path) for d in problems):
        yield from (d for d in problems if d.rule in _OF_BASE)
