"""Slips with keys and indentation."""

import re
from collections.abc import Iterator

from dodo_dsl.diagnostics import Fix
from dodo_dsl.slips.failure import KEY, PLAIN_KEY, VALUES, Failure, Slip, indent, shortened, spaces

_NO_BLANK = re.compile(r"\s*(?:- )?(?P<key>[A-Za-z_][\w.-]*):(?P<value>(?!//)[^\s:].*)")
_NO_COLON = re.compile(r"\s*(?:- )?(?P<key>[A-Za-z_][\w.-]*)(?P<sign>\s*=|\s+|$)(?P<value>.*)")


def no_blank_after_colon(failure: Failure) -> Iterator[Slip]:
    number = failure.suspect
    found = _NO_BLANK.fullmatch(failure.line(number))
    if found and ": " not in failure.line(number):
        key, value = found["key"], found["value"].strip()
        hint = f"write '{key}: {shortened(value)}'"
        is_clear = not value.startswith("#") and PLAIN_KEY.fullmatch(key)  # and no text that goes on: 'Note:this'
        fix = Fix(":", ": ") if is_clear else None
        yield Slip(number, found.end("key"), f"a space is missing after the colon of '{key}'", hint, fix=fix)


def no_colon(failure: Failure) -> Iterator[Slip]:
    number = failure.suspect
    line = failure.line(number)
    if line.lstrip().startswith("//"):
        yield Slip(number, indent(line), "'//' does not begin a comment", "comments begin with '#'")
        return
    found = _NO_COLON.fullmatch(line)
    if not found or ": " in line or line.rstrip().endswith(":"):
        return
    key, value = found["key"], found["value"].strip()
    hint = f"write '{key}: {shortened(value)}'" if value else f"write '{key}:'"
    if _goes_on(failure, number):
        hint += ", or indent the line if it goes on with the text above"
    message = f"'=' stands after '{key}'" if "=" in found["sign"] else f"a colon is missing after '{key}'"
    yield Slip(number, found.start("key"), f"{message}, expected a colon" if "=" in found["sign"] else message, hint)


def _goes_on(failure: Failure, number: int) -> bool:
    """Whether the line above ends with a text of several words, which a line may go on with."""
    above = KEY.fullmatch(failure.line(failure.above(number)))
    return bool(above and " " in (above["value"] or "").strip() and above["value"][0] not in "\"'[{|>")


def too_deep(failure: Failure) -> Iterator[Slip]:
    number = failure.mark[0]
    above = failure.above(number)
    found = KEY.fullmatch(failure.line(above))
    deep, usual = indent(failure.line(number)), indent(failure.line(above))
    if VALUES in failure.problem and found and found["value"] and deep > usual:
        message = f"indented deeper than '{found['key']}' above, which has its value already"
        where = f"indent it by {spaces(usual)}" if usual else "begin it in the first column"
        yield Slip(number, deep, message, f"{where}, as line {above + 1}")


def between_levels(failure: Failure) -> Iterator[Slip]:
    """A line whose indentation is that of no line above."""
    number = failure.mark[0]
    deep = indent(failure.line(number))
    if "expected key" not in failure.problem or failure.before.strip():
        return
    levels = _levels(failure, number)
    if deep in levels:
        return
    near = [*[level for level in levels if level < deep][:1], *[level for level in levels if level > deep][-1:]]
    expected = " or ".join(str(level) for level in sorted(near))
    message = f"indented by {spaces(deep)}, but the lines above by {expected}"
    yield Slip(number, deep, message, "keys of one mapping begin in the same column")


def unexpected(failure: Failure) -> Iterator[Slip]:
    """What no other slip explains, in general words."""
    above = failure.above(failure.mark[0])
    if VALUES in failure.problem and above >= 0:
        key = failure.before.strip() or "key"
        hint = f"is line {above + 1} complete, and is this line indented as it is meant?"
        yield Slip(failure.mark[0], indent(failure.before), f"the key '{shortened(key)}' is not expected here", hint)
    elif failure.here.strip() and re.search("expected key|node content", failure.problem):
        hint = "remove it, or write a text that begins with it in quotes"
        yield Slip(*failure.mark, f"'{failure.here[0]}' is not expected here", hint)


def _levels(failure: Failure, number: int) -> list[int]:
    """The indentations of the mappings that are open above a line, the deepest first."""
    levels: list[int] = []
    while (number := failure.above(number)) >= 0:
        deep = indent(failure.line(number))
        if not levels or deep < levels[-1]:
            levels.append(deep)
    return levels
