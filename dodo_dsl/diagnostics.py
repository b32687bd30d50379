"""Problems as values: position, rule, message and hint."""

import difflib
import functools
import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from dodo_dsl.terminal import columns, excerpt, json_text, printable

Severity = Literal["error", "warning"]
Piece = tuple[str, str]
"""A part of a text, and its style by name; empty for none."""

_MOST_NAMED = 3
_INDENT = 2
_MAX_FILE = 1 << 20
_PARTS = re.compile(r"[-._]")


@dataclass(frozen=True, order=True)
class Span:
    """A position in a file; line and column count from 1, ``length`` is what a code frame underlines.

    There is no frame with a ``length`` of 0, as for lines that hold secrets.
    """

    file: str
    line: int = 1
    column: int = 1
    length: int = 1


@dataclass(frozen=True, order=True)
class Diagnostic:
    """One problem; ``rule`` is its name in the rule catalogue.

    ``tests`` are those that it depends on, where its position does not say so.
    """

    span: Span
    rule: str
    message: str
    hint: str = ""
    severity: Severity = "error"
    tests: tuple[str, ...] = field(default=(), compare=False)

    @property
    def sentence(self) -> str:
        """The message, with the tests that have the problem, or their number if they are many."""
        if not self.tests:
            return self.message
        many = f"{len(self.tests)} tests, such as {self.tests[0]}"
        names = many if len(self.tests) > _MOST_NAMED else listed(self.tests)
        return f"{self.message.removesuffix('.')} (in {names})"


def listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    return any(d.severity == "error" for d in diagnostics)


def ordered(diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
    return sorted(set(diagnostics))


def closest(word: str, known: Iterable[str]) -> list[str]:
    """The known word in another case, or of the same parts in another order: ``virtual-camera``, ``camera-virtual``.

    Otherwise at most two that are spelt alike, the nearest first.
    """
    choices = sorted(known)
    if same := [choice for choice in choices if choice.lower() == word.lower()]:
        return same[:1]
    parts = sorted(_PARTS.split(word.lower()))
    turned = [choice for choice in choices if len(parts) > 1 and sorted(_PARTS.split(choice.lower())) == parts]
    return turned[:1] or difflib.get_close_matches(word.lower(), choices, n=2, cutoff=0.6)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A hint that names the nearest known words, or all of them when they are few; empty when there are none."""
    choices = sorted(known)
    close = closest(word, choices)
    if close:
        return "did you mean " + " or ".join(f"'{c}'" for c in close) + "?"
    if 0 < len(choices) <= 12:
        return "known: " + ", ".join(choices)
    return ""


def shown_path(file: str) -> str:
    path = Path(file)
    if not path.is_absolute():
        return file
    relative = os.path.relpath(path)
    return file if relative.startswith("..") else relative


@functools.lru_cache(maxsize=4)
def _lines(file: str) -> list[str]:
    path = Path(file)
    if not path.is_file():
        return []
    with path.open("rb") as stream:
        return stream.read(_MAX_FILE).decode("utf-8", "replace").splitlines()


def forget_lines() -> None:
    """To be called when files have changed."""
    _lines.cache_clear()


def _source_line(span: Span) -> str | None:
    try:
        lines = _lines(span.file)
    except OSError:
        return None
    return lines[span.line - 1] if 0 < span.line <= len(lines) else None


def _code_frame(span: Span, width: int) -> Iterator[Piece]:
    line = _source_line(span) if span.length else None
    if line is None or not 0 < span.column <= len(line) + 1:
        return
    gutter = str(span.line)
    room = width - len(f"  {gutter} | ") - (span.column > len(line))
    before, place, behind = excerpt(line, span.column - 1, span.length, room)
    yield f"  {gutter} | ", "gutter"
    yield f"{before}{place}{behind}\n", ""
    yield f"  {' ' * len(gutter)} | ", "gutter"
    yield " " * len(before), ""
    yield "^" * max(1, len(place)), "mark"
    yield "\n", ""


def pieces(diagnostic: Diagnostic, width: int) -> Iterator[Piece]:
    """The lines of a diagnostic in parts, with a code frame of at most ``width`` columns."""
    span = diagnostic.span
    yield f"{printable(shown_path(span.file))}:{span.line}:{span.column}: ", "place"
    yield f"{diagnostic.severity}[{diagnostic.rule}]", diagnostic.severity
    yield f": {printable(diagnostic.sentence)}\n", ""
    yield from _code_frame(span, width)
    if diagnostic.hint:
        yield "  hint: ", "hint"
        yield f"{printable(diagnostic.hint)}\n", ""


def format_text(diagnostics: Sequence[Diagnostic], width: int | None = None) -> str:
    """With code frames of at most ``width`` columns, by default as the terminal has for an error's indented lines."""
    return "".join(text for d in diagnostics for text, _ in pieces(d, width or columns() - _INDENT))


def format_json(diagnostics: Sequence[Diagnostic]) -> str:
    rows = [
        {
            "file": shown_path(d.span.file),
            "line": d.span.line,
            "column": d.span.column,
            "severity": d.severity,
            "rule": d.rule,
            "message": d.message,
            "hint": d.hint,
            "tests": list(d.tests),
        }
        for d in diagnostics
    ]
    return json_text(rows)


def format_gitlab(diagnostics: Sequence[Diagnostic]) -> str:
    rows = [
        {
            "description": d.sentence + (f" ({d.hint})" if d.hint else ""),
            "check_name": d.rule,
            "fingerprint": fingerprint,
            "severity": "major" if d.severity == "error" else "minor",
            "location": {"path": shown_path(d.span.file), "lines": {"begin": d.span.line}},
        }
        for d, fingerprint in zip(diagnostics, fingerprints(diagnostics), strict=True)
    ]
    return json_text(rows)


def fingerprints(diagnostics: Iterable[Diagnostic]) -> Iterator[str]:
    """A digest of each, which stays the same when lines move."""
    seen: dict[str, int] = {}
    for d in diagnostics:
        identity = f"{shown_path(d.span.file)}\0{d.rule}\0{d.message}"
        seen[identity] = seen.get(identity, 0) + 1
        yield hashlib.sha256(f"{identity}\0{seen[identity]}".encode()).hexdigest()
