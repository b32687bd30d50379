"""What is wrong with text that is not YAML, in the words of its author: the slips that people make most."""

import re
from dataclasses import dataclass
from typing import NamedTuple

from dodo_dsl.diagnostics import Diagnostic, Span

_KEY = r"(?P<key>[A-Za-z_][\w.-]*)"
_LONGEST = 1000
"""Characters of a line that patterns are tried on."""


class _Pattern(NamedTuple):
    """A slip of one line, whose group ``at`` is what is wrong; other groups fill the texts."""

    pattern: str
    message: str
    hint: str


_OF_KEYS = (
    _Pattern(r" *(?P<at>-)(?P<value>[^-\s].*)", "a space is missing after '-'", "write '- {value}'"),
    _Pattern(rf"(?!.*: )\s*(?:- )?{_KEY}(?P<at>:)(?P<value>(?!//)[^\s:#].*)",
             "a space is missing after the colon of '{key}'", "write '{key}: {value}'"),
    _Pattern(rf"(?!.*: )(?!.*:\s*$)\s*(?:- )?(?P<at>){_KEY}(?:[\s=]+(?P<value>\S.*)|\s*)",
             "a colon is missing after '{key}'",
             "write '{key}: {value}', or indent the line if it goes on with the text above"),
)  # fmt: skip
_IN_BRACKETS = (
    _Pattern(r".*(?P<at>\$)\0(?P<name>\{[\w.-]+\}).*", "'${name}' within brackets needs quotes", 'write "${name}"'),
    _Pattern(r".*\s(?P<at>)(?P<key>[\w.-]+)\s*\0:.*", "a comma is missing before '{key}'",
             "entries within brackets are separated by commas"),
)  # fmt: skip
_TWO_COLONS = _Pattern(r"\s*(?:- )?(?P<key>[^:]*): .*(?P<at>\0).*",
                       "a second colon in the value of '{key}', which must be one string",
                       "put the text in quotes, or write a mapping in braces or into the next lines")  # fmt: skip
_VALUE = re.compile(rf"\s*(?:- )?{_KEY}:\s+\S.*")
_OPEN_QUOTE = re.compile(r"\s*(?:- )?[\w.-]+:\s+(?P<quote>[\"'])(?:(?!(?P=quote)).)*")
_FOREIGN = re.compile("(?:^\\s*|:)(?P<blank>[\u00a0\u2000-\u200b\u202f\u3000\ufeff])")
"""As word processors and web pages have them."""


@dataclass(frozen=True)
class Failure:
    """What libyaml says of a file's ``lines``; ``begin`` is where it began to read what failed at ``mark``.

    Both are line and column, from 0.
    """

    file: str
    lines: list[str]
    problem: str
    mark: tuple[int, int]
    context: str
    begin: tuple[int, int] | None

    def line(self, number: int) -> str:
        return self.lines[number] if 0 <= number < len(self.lines) else ""

    def above(self, number: int) -> int:
        """The nearest line above that is neither empty nor a comment; -1 when there is none."""
        return next(
            (n for n in range(number - 1, -1, -1) if self.line(n).strip() and self.line(n).strip()[0] != "#"), -1
        )

    def wrong(self, line: int, column: int, message: str, hint: str) -> Diagnostic:
        return Diagnostic(Span(self.file, line + 1, column + 1), "yaml-syntax", message, hint)

    def matched(self, number: int, pattern: _Pattern, at: int | None = None) -> Diagnostic | None:
        """What a pattern finds in a line, which has a NUL ``at`` the column where the parser gave up."""
        line = self.line(number)
        line = line if at is None else f"{line[:at]}\0{line[at:]}"
        found = re.fullmatch(pattern.pattern, line) if number >= 0 and len(line) <= _LONGEST else None
        if found is None:
            return None
        words = {name: (text or "...").replace("\0", "").strip()[:60] for name, text in found.groupdict().items()}
        column = found.start("at") - line[: found.start("at")].count("\0")
        return self.wrong(number, column, pattern.message.format(**words), pattern.hint.format(**words))


def slip(failure: Failure) -> Diagnostic | None:
    """The first explanation that fits what the parser stumbled over; None when there is none."""
    (row, column), begin, above = failure.mark, failure.begin, failure.above(failure.mark[0])
    if found := _blank(failure, above) or _open_quote(failure):
        return found
    if begin and "simple key" in failure.context:
        return _first(failure, begin[0])
    if "mapping values are not allowed" in failure.problem:
        if ": " in failure.line(row)[:column]:
            return failure.matched(row, _TWO_COLONS, column)
        return _first(failure, above) or _too_deep(failure, above)
    if begin and "flow" in failure.context:
        if row != begin[0] and _indent(failure.line(row)) <= _indent(failure.line(begin[0])):
            return failure.wrong(*begin, "this bracket is not closed", f"close it at the end of line {above + 1}")
        return next((d for each in _IN_BRACKETS if (d := failure.matched(row, each, column))), None)
    if begin and "'-' indicator" in failure.problem and failure.line(row)[column : column + 1] != "-":
        message = f"'- ' begins a list here, but line {row + 1} goes on with a key"
        return failure.wrong(*begin, message, "remove the '- ' for a mapping of keys")
    if "expected key" in failure.problem or "'-' indicator" in failure.problem:
        return _between_levels(failure)
    return None


def _blank(failure: Failure, above: int) -> Diagnostic | None:
    row, column = failure.mark
    for number in (row, above):
        line = failure.line(number)
        if "\t" in line[: len(line) - len(line.lstrip())]:
            message = "this line is indented with a tab"
            return failure.wrong(number, line.index("\t"), message, "indent with spaces")
    if failure.line(row)[column:].startswith("\t"):
        return failure.wrong(row, column, "a tab where a space is expected", "write a space")
    for number in range(min(row, above), row + 1):
        if found := _FOREIGN.search(failure.line(number)):
            message = f"this blank is not a space (U+{ord(found['blank']):04X})"
            return failure.wrong(number, found.start("blank"), message, "write a space, or nothing")
    return None


def _open_quote(failure: Failure) -> Diagnostic | None:
    """Also where the next quotation mark, lines below, closes it."""
    begin = failure.begin if "quoted scalar" in failure.context else None
    for number in () if begin else range(failure.mark[0]):
        if found := _OPEN_QUOTE.fullmatch(failure.line(number)[:_LONGEST]):
            begin = number, found.start("quote")
    if begin is None:
        return None
    quote = failure.line(begin[0])[begin[1] : begin[1] + 1]
    return failure.wrong(*begin, "this quotation mark is not closed in its line", f"add {quote} at the end of the text")


def _first(failure: Failure, number: int) -> Diagnostic | None:
    return next((found for each in _OF_KEYS if (found := failure.matched(number, each))), None)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _too_deep(failure: Failure, above: int) -> Diagnostic | None:
    number = failure.mark[0]
    found = _VALUE.fullmatch(failure.line(above)[:_LONGEST])
    deep, usual = _indent(failure.line(number)), _indent(failure.line(above))
    if not found or deep <= usual:
        return None
    message = f"indented deeper than '{found['key']}' above, which has its value already"
    return failure.wrong(number, deep, message, f"indent it by {usual}, as line {above + 1}, or put a text in quotes")


def _between_levels(failure: Failure) -> Diagnostic | None:
    number = failure.mark[0]
    deep = _indent(failure.line(number))
    if failure.mark[1] > deep:
        return None
    levels, above = list[int](), number
    while (above := failure.above(above)) >= 0:
        usual = _indent(failure.line(above))
        if not levels or usual < levels[-1]:
            levels.append(usual)
    if deep in levels:
        return None
    near = [*[level for level in levels if level < deep][:1], *[level for level in levels if level > deep][-1:]]
    message = f"indented by {deep}, but the lines above by {' or '.join(str(level) for level in sorted(near))}"
    return failure.wrong(number, deep, message, "keys of one mapping begin in the same column")
