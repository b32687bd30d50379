"""Slips of single characters: tabs, blanks that are none, and characters with a meaning in YAML."""

import re
import unicodedata
from collections.abc import Iterator

from dodo_dsl.diagnostics import Fix
from dodo_dsl.slips.failure import Failure, Slip

_CONFLICT = re.compile(r"(<{7}|>{7}|\|{7}) |={7}$")
_BLANKS = "\u00a0\u1680\u2000-\u200b\u202f\u205f\u3000\ufeff"
_FOREIGN = re.compile(rf"(?:^\s*|:)(?P<blank>[{_BLANKS}])")

_COMMENT = re.compile(r"(?<=\s)(?P<sign>#)")


def conflict(failure: Failure) -> Iterator[Slip]:
    for number, line in enumerate(failure.lines):
        if _CONFLICT.match(line):
            hint = "keep one of the two versions, and remove the lines that git added"
            yield Slip(number, 0, "a conflict of git is not resolved", hint)


def tab(failure: Failure) -> Iterator[Slip]:
    for number in (failure.mark[0], failure.above(failure.mark[0])):
        line = failure.line(number)
        head = line[: len(line) - len(line.lstrip())]
        if "\t" in head:
            message = "this line is indented with a tab"
            yield Slip(number, line.index("\t"), message, "indent with spaces", is_tab=True)
    if failure.here.startswith("\t"):
        yield Slip(*failure.mark, "a tab where a space is expected", "write a space", is_tab=True)


def foreign_blank(failure: Failure) -> Iterator[Slip]:
    """As word processors and web pages have them."""
    first = failure.begin[0] if failure.begin else failure.mark[0]
    for number in range(min(first, failure.above(failure.mark[0])), failure.mark[0] + 1):
        found = _FOREIGN.search(failure.line(number))
        if found:
            blank = found["blank"]
            name = unicodedata.name(blank, "unnamed").lower()
            message = f"this blank is not a space but a {name} (U+{ord(blank):04X})"
            is_nothing = "zero width" in name
            fix = Fix(blank, "" if is_nothing else " ")
            yield Slip(number, found.start("blank"), message, "remove it" if is_nothing else "write a space", fix=fix)


def comment(failure: Failure) -> Iterator[Slip]:
    """A '#' within brackets hides what closes them; the parser notices it in a later line, or at the end."""
    if "flow" not in failure.context or not failure.begin:
        return
    for number in range(max(failure.begin[0] - 1, 0), failure.mark[0] + 1):
        found = _COMMENT.search(line := failure.line(number))
        if found and _is_open(line[: found.start("sign")]) and re.search(r"[]}]", line[found.end() :]):
            message = "'#' behind a blank begins a comment, which hides the closing bracket"
            yield Slip(number, found.start("sign"), message, "write the text in quotes, or close the bracket before it")


def _is_open(text: str) -> bool:
    """Whether more brackets are opened than closed in it."""
    return sum(text.count(sign) for sign in "{[") > sum(text.count(sign) for sign in "}]")


def behind_the_end(failure: Failure) -> Iterator[Slip]:
    if "<document start>" in failure.problem:
        ends = [number for number in range(failure.mark[0]) if failure.line(number).rstrip() == "..."]
        message = "'...' ends the document, and text stands behind it"
        yield Slip(ends[-1] if ends else failure.mark[0], 0, message, "remove this line")


def block_text(failure: Failure) -> Iterator[Slip]:
    if "block scalar" in failure.context:
        sign = failure.line(failure.begin[0])[failure.begin[1]] if failure.begin else "|"
        message = f"text stands behind '{sign}', expected it in the lines below"
        yield Slip(*failure.mark, message, f"remove the '{sign}', or write the text indented into the next line")
