"""What is wrong with text that is not YAML, in the words of its author: a table of the slips that people make."""

import functools
import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import yaml

from dodo_dsl.diagnostics import Diagnostic, Fix, Span

_KINDS = {
    "quoted scalar": "quote",
    "simple key": "key",
    "mapping values are not allowed": "colon",
    "expected ',' or": "flow",
    "expected key": "mapping",
    "'-' indicator": "sequence",
    "block sequence entries": "dash",
    "cannot start any token": "character",
}
"""What the parser expected, by words of its messages, which only this table knows; others are of kind ``other``."""
_CLOSING = {"{": "}", "[": "]"}
_KEY = re.compile(r"\s*(?:- )?(?P<key>[A-Za-z_][\w.-]*):(?:\s+(?P<value>.*))?$")
_KEY_LINE = re.compile(r"\s*(?:- )?[\w.-]+:(?:\s|$)")
_FOREIGN = re.compile("(?:^\\s*|:)(?P<blank>[\u00a0\u2000-\u200b\u202f\u3000\ufeff])")
_MARK = "\0"
"""Stands in a line where the parser gave up; YAML has no such character."""
_LONGEST = 1000
"""Characters of a line that patterns are tried on."""


@dataclass(frozen=True)
class Failure:
    """``problem`` and ``context`` are libyaml's words; ``begin`` is where it began to read what failed at ``mark``.

    Both are line and column, from 0.
    """

    file: str
    text: str
    problem: str
    mark: tuple[int, int]
    context: str
    begin: tuple[int, int] | None
    loader: Any

    @functools.cached_property
    def kind(self) -> str:
        said = f"{self.context}: {self.problem}"
        return next((kind for words, kind in _KINDS.items() if words in said), "other")

    @functools.cached_property
    def lines(self) -> list[str]:
        """The lines of the text, empty within a block text, below ``|`` or ``>``, if anything may stand."""
        found = self.text.splitlines()
        for token in self.tokens:
            if isinstance(token, yaml.ScalarToken) and token.style in ("|", ">"):
                end = token.end_mark.line + bool(token.end_mark.column)
                for number in range(token.start_mark.line + 1, min(end, len(found))):
                    found[number] = ""
        return found

    def line(self, number: int) -> str:
        return self.lines[number] if 0 <= number < len(self.lines) else ""

    @property
    def here(self) -> str:
        """The rest of the line from the mark on."""
        return self.line(self.mark[0])[self.mark[1] :]

    @property
    def before(self) -> str:
        return self.line(self.mark[0])[: self.mark[1]]

    @property
    def opening(self) -> str:
        """The character with which the parser began what failed."""
        return self.line(self.begin[0])[self.begin[1] : self.begin[1] + 1] if self.begin else ""

    def above(self, number: int) -> int:
        """The nearest line above that is neither empty nor a comment; -1 when there is none."""
        while number > 0:
            number -= 1
            if (text := self.line(number).strip()) and text[0] != "#":
                return number
        return -1

    @functools.cached_property
    def suspect(self) -> int:
        """The line that is not as meant: where a key was expected, or above an unexpected colon; -1 for none."""
        if self.kind == "key" and self.begin:
            return self.begin[0]
        is_above = self.kind == "mapping" or (self.kind == "colon" and ": " not in self.before)
        return self.above(self.mark[0]) if is_above else -1

    def wrong(
        self, line: int, column: int, message: str, hint: str, fix: Fix | None = None, length: int = 1
    ) -> Diagnostic:
        """What is wrong at a place; ``fix`` is for the ``length`` characters there, if there is exactly one."""
        return Diagnostic(Span(self.file, line + 1, column + 1, length), "yaml-syntax", message, hint, fix=fix)

    @functools.cached_property
    def tokens(self) -> list[Any]:
        """The tokens up to the mark, as far as there are any."""
        found = []
        try:
            for token in yaml.scan(self.text, Loader=self.loader):
                if (token.start_mark.line, token.start_mark.column) > self.mark:
                    break
                found.append(token)
        except yaml.YAMLError:
            pass
        return found


def _indent(line: str) -> int:
    """The number of spaces that a line begins with."""
    return len(line) - len(line.lstrip(" "))


def _spaces(number: int) -> str:
    return f"{number} space{'' if number == 1 else 's'}"


def _shortened(text: str) -> str:
    """A piece of a line for a message."""
    return text if len(text) <= 60 else text[:57] + "..."


class _Pattern(NamedTuple):
    """A slip that one line shows: that of the mark, where the parser began, or that which is not as meant.

    ``pattern`` is of the whole line, with a sign at the place; its group ``at`` is what is wrong, and with a ``fix``
    what that replaces. Other groups fill the texts.
    """

    kinds: str
    where: str
    pattern: str
    message: str
    hint: str
    fix: str = ""

    def __call__(self, failure: Failure) -> Diagnostic | None:
        place = {"mark": failure.mark, "begin": failure.begin}.get(self.where)
        number = place[0] if place else failure.suspect
        line = failure.line(number)
        line = f"{line[: place[1]]}{_MARK}{line[place[1] :]}" if place else line
        is_meant = failure.kind in self.kinds.split() and len(line) <= _LONGEST
        found = re.fullmatch(self.pattern, line) if is_meant else None
        if found is None or number < 0:
            return None
        words = {name: _shortened((text or "").replace(_MARK, "").strip()) for name, text in found.groupdict().items()}
        words |= {"line": str(failure.mark[0] + 1), "opening": failure.opening}
        words["closing"] = _CLOSING.get(failure.opening, "")
        at = found["at"].replace(_MARK, "")
        column = found.start("at") - line[: found.start("at")].count(_MARK)
        fix = Fix(at, self.fix.format(**words)) if self.fix else None
        message, hint = self.message.format(**words), self.hint.format(**words)
        return failure.wrong(number, column, message, hint, fix, max(1, len(at)))


def _conflict(failure: Failure) -> Diagnostic | None:
    number = next((n for n, line in enumerate(failure.lines) if re.match(r"(<{7}|>{7}|\|{7}) |={7}$", line)), -1)
    hint = "keep one of the two versions, and remove the lines that git added"
    return failure.wrong(number, 0, "a conflict of git is not resolved", hint) if number >= 0 else None


def _tab(failure: Failure) -> Diagnostic | None:
    row, column = failure.mark
    for number in (row, failure.above(row)):
        line = failure.line(number)
        if "\t" in line[: len(line) - len(line.lstrip())]:
            place = Span(failure.file, number + 1, line.index("\t") + 1)
            return Diagnostic(place, "yaml-tab", "this line is indented with a tab", "indent with spaces")
    if failure.here.startswith("\t"):
        place = Span(failure.file, row + 1, column + 1)
        return Diagnostic(place, "yaml-tab", "a tab where a space is expected", "write a space")
    return None


def _foreign_blank(failure: Failure) -> Diagnostic | None:
    """As word processors and web pages have them."""
    first = failure.begin[0] if failure.begin else failure.mark[0]
    for number in range(min(first, failure.above(failure.mark[0])), failure.mark[0] + 1):
        if found := _FOREIGN.search(failure.line(number)):
            blank = found["blank"]
            name = unicodedata.name(blank).lower()
            message = f"this blank is not a space but a {name} (U+{ord(blank):04X})"
            new, hint = ("", "remove it") if "zero width" in name else (" ", "write a space")
            return failure.wrong(number, found.start("blank"), message, hint, fix=Fix(blank, new))
    return None


def _open_quote(failure: Failure) -> Diagnostic | None:
    """Also where the next quotation mark, lines below, closes it."""
    begin = failure.begin if failure.kind == "quote" else None
    for token in () if begin else failure.tokens:
        first, last = token.start_mark, token.end_mark
        is_quoted = isinstance(token, yaml.ScalarToken) and token.style in ("'", '"')
        if is_quoted and any(map(_KEY_LINE.match, failure.lines[first.line + 1 : last.line + 1])):
            begin = first.line, first.column
            break
    if begin is None:
        return None
    quote = failure.line(begin[0])[begin[1] : begin[1] + 1]
    return failure.wrong(*begin, "this quotation mark is not closed in its line", f"add {quote} at the end of the text")


def _too_deep(failure: Failure) -> Diagnostic | None:
    number = failure.mark[0]
    above = failure.above(number)
    found = _KEY.fullmatch(failure.line(above))
    deep, usual = _indent(failure.line(number)), _indent(failure.line(above))
    if failure.kind != "colon" or not found or not found["value"] or deep <= usual:
        return None
    message = f"indented deeper than '{found['key']}' above, which has its value already"
    where = f"indent it by {_spaces(usual)}" if usual else "begin it in the first column"
    return failure.wrong(number, deep, message, f"{where}, as line {above + 1}, or put a text that goes on in quotes")


def _between_levels(failure: Failure) -> Diagnostic | None:
    """A line whose indentation is that of no line above, or an item among keys."""
    number = failure.mark[0]
    deep = _indent(failure.line(number))
    if failure.kind != "mapping" or failure.before.strip():
        return None
    levels, above = list[int](), number
    while (above := failure.above(above)) >= 0:
        usual = _indent(failure.line(above))
        if not levels or usual < levels[-1]:
            levels.append(usual)
    if deep in levels:
        message = "'- ' begins an item of a list, expected a key as in the lines above"
        return failure.wrong(*failure.mark, message, "remove the '- '") if re.match(r"-(\s|$)", failure.here) else None
    near = [*[level for level in levels if level < deep][:1], *[level for level in levels if level > deep][-1:]]
    expected = " or ".join(str(level) for level in sorted(near))
    message = f"indented by {_spaces(deep)}, but the lines above by {expected}"
    return failure.wrong(number, deep, message, "keys of one mapping begin in the same column")


def _open_bracket(failure: Failure) -> Diagnostic | None:
    opening, begin = failure.opening, failure.begin
    if failure.kind != "flow" or begin is None or failure.mark[0] == begin[0]:
        return None
    first, last = failure.line(begin[0]), failure.line(failure.mark[0])
    if last.strip() and _indent(last) > _indent(first) and first.rstrip()[-1:] in (",", opening):
        return None
    end = failure.above(failure.mark[0]) + 1
    return failure.wrong(*begin, f"'{opening}' is not closed", f"add '{_CLOSING[opening]}' at the end of line {end}")


_NAME = r"(?P<key>[A-Za-z_][\w.-]*)"
_NO_COLON = rf"(?!.*: )(?!.*:\s*$)\s*(?:- )?(?P<at>){_NAME}"
_WRITE = "write '{key}: {value}'"
_COMMAS = "entries within brackets are separated by commas"
_SUSPECTS = "key colon"

_SLIPS: tuple[_Pattern | Callable[[Failure], Diagnostic | None], ...] = (
    _conflict,
    _tab,
    _foreign_blank,
    _open_quote,
    _Pattern("mapping flow sequence other", "mark", r".*[\"']\s*(?P<at>\0)[^\s,\]}:].*",
             "text stands behind the closing quotation mark", "put the whole text in quotes of the other kind"),
    _Pattern(_SUSPECTS, "suspect", r" *(?P<at>-)(?P<value>[^-\s].*)",
             "a space is missing after '-'", "write '- {value}'", "- "),
    *(_Pattern(_SUSPECTS, "suspect", rf"(?!.*: )\s*(?:- )?{name}(?P<at>:)(?P<value>(?!//)[^\s:#].*)",
               "a space is missing after the colon of '{key}'", _WRITE, fix)
      for name, fix in ((r"(?P<key>[a-z][a-z0-9-]*)", ": "), (_NAME, ""))),
    _Pattern("colon", "mark", r"\s*(?:- )?(?P<key>[^:]*): .*(?P<at>\0).*",
             "a second colon in the value of '{key}', which must be one string",
             "put the text in quotes, or write a mapping in braces or into the next lines"),
    _Pattern(_SUSPECTS, "suspect", rf"{_NO_COLON}[\s=]+(?P<value>\S.*)",
             "a colon is missing after '{key}'", _WRITE + ", or indent the line if it goes on with the text above"),
    _Pattern(_SUSPECTS, "suspect", rf"{_NO_COLON}\s*", "a colon is missing after '{key}'",
             "write '{key}:', or indent the line if it goes on with the text above"),
    _too_deep,
    _Pattern("sequence", "begin", r".*(?P<at>\0).*",
             "'- ' begins a list here, but line {line} goes on with a key", "remove the '- ' for a mapping of keys"),
    _Pattern("dash", "mark", r".*(?P<at>\0).*", "a list with '- ' cannot begin behind its key",
             "write the list in brackets, or each item into its own line"),
    _Pattern("mapping sequence other", "mark", r".*\0(?P<at>[]}]).*",
             "'{at}' closes nothing", "remove it: there is one bracket too many"),
    _between_levels,
    _open_bracket,
    _Pattern("flow", "mark", r".*\0(?P<at>[]}]).*", "'{at}' closes what '{opening}' opened", "write '{closing}'"),
    _Pattern("flow", "mark", r".*\s(?P<at>)(?P<key>[\w.-]+)\s*\0:.*", "a comma is missing before '{key}'", _COMMAS),
    _Pattern("flow", "mark", r".*(?P<at>\$)\0(?P<name>\{[\w.-]+\}).*",
             "'${name}' within brackets needs quotes, as braces mean something else in YAML", 'write "${name}"'),
    _Pattern("flow", "mark", r".*\0(?P<at>)\s*\S.*", "a comma is missing, or the text needs quotes", _COMMAS),
    _Pattern("character", "mark", r".*\0(?P<at>.).*", "a text cannot begin with '{at}'", "write the text in quotes"),
    _Pattern("other", "mark", r".*\0\s*(?P<at>\S).*", "'{at}' is not expected here",
             "remove it, or write the text in quotes"),
)  # fmt: skip


def slip(failure: Failure) -> Diagnostic | None:
    """The first explanation that fits what the parser stumbled over; None when there is none."""
    return next((found for one in _SLIPS if (found := one(failure))), None)
