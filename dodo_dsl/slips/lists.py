"""Slips with lists."""

import re
from collections.abc import Iterator

from dodo_dsl.diagnostics import Fix
from dodo_dsl.slips.failure import Failure, Slip, indent, shortened, spaces

_ITEM = re.compile(r"-(\s|$)")
_NO_BLANK = re.compile(r" *(?P<dash>-)(?P<value>[^-\s].*)")
_OTHER_DASH = re.compile(r" *(?P<dash>[\u2010-\u2015\u2212]) *(?P<value>[^\s].*)")


def no_blank_after_dash(failure: Failure) -> Iterator[Slip]:
    number = failure.suspect
    if found := _NO_BLANK.fullmatch(failure.line(number)):
        hint = f"write '- {shortened(found['value'].strip())}'"
        yield Slip(number, found.start("dash"), "a space is missing after '-'", hint, fix=Fix("-", "- "))


def other_dash(failure: Failure) -> Iterator[Slip]:
    """As word processors write it."""
    number = failure.suspect
    if found := _OTHER_DASH.fullmatch(failure.line(number)):
        gap = "-" if " " in found[0][found.start("dash") : found.start("value")] else "- "
        message = f"'{found['dash']}' (U+{ord(found['dash']):04X}) begins no item of a list, expected '-'"
        hint = f"write '- {shortened(found['value'].strip())}'"
        yield Slip(number, found.start("dash"), message, hint, fix=Fix(found["dash"], gap))


def item_too_shallow(failure: Failure) -> Iterator[Slip]:
    """An item that begins in a column before the one of the items above."""
    number = failure.mark[0]
    deep = indent(failure.line(number))
    if "expected key" not in failure.problem or failure.before.strip() or not _ITEM.match(failure.here):
        return
    while indent(failure.line(number := failure.above(number))) > deep and number >= 0:
        line = failure.line(number)
        if _ITEM.match(line.lstrip()):
            message = f"this item is indented by {spaces(deep)}, but the one in line {number + 1} by {indent(line)}"
            yield Slip(failure.mark[0], deep, message, f"indent it by {spaces(indent(line))}")
            return


def dash(failure: Failure) -> Iterator[Slip]:
    """A list item among keys."""
    begins = not failure.before.strip()
    if "expected key" in failure.problem and begins and _ITEM.match(failure.here):
        message = "'- ' begins an item of a list, expected a key as in the lines above"
        yield Slip(*failure.mark, message, "remove the '- '")


def list_with_key(failure: Failure) -> Iterator[Slip]:
    """Keys that go on where a list began."""
    if "'-' indicator" in failure.problem and failure.begin:
        other = failure.mark[0] + 1
        message = f"'- ' begins a list here, but line {other} goes on with a key"
        yield Slip(*failure.begin, message, "remove the '- ' for a mapping of keys")


def list_behind_key(failure: Failure) -> Iterator[Slip]:
    if "block sequence entries are not allowed" in failure.problem:
        hint = "write the list in brackets, or each item into its own line"
        yield Slip(*failure.mark, "a list with '- ' cannot begin behind its key", hint)
