"""Slips with braces, brackets and the commas within."""

import re
from collections.abc import Iterator

from dodo_dsl.slips.failure import Failure, Slip, indent

_CLOSING = {"{": "}", "[": "]"}
_PLACEHOLDER = re.compile(r"\{[\w.-]+\}")
_LAST_WORD = re.compile(r"(?P<gap>[;\s]+)(?P<key>[\w.-]+)\s*$")


def _opening(failure: Failure) -> str:
    """The bracket within which the parser gave up."""
    if not failure.begin or "expected ',' or" not in failure.problem:
        return ""
    sign = failure.line(failure.begin[0])[failure.begin[1] : failure.begin[1] + 1]
    return sign if sign in _CLOSING else ""


def one_too_many(failure: Failure) -> Iterator[Slip]:
    sign = failure.here[:1]
    if sign and sign in "}]" and not _opening(failure) and "expected" in failure.problem:
        yield Slip(*failure.mark, f"'{sign}' closes nothing", "remove it: there is one bracket too many")
    elif failure.before.rstrip()[-1:] in ("}", "]") and "expected key" in failure.problem:
        message = f"text stands behind the closing '{failure.before.rstrip()[-1]}'"
        yield Slip(*failure.mark, message, "move it inside, or remove it")


def unclosed(failure: Failure) -> Iterator[Slip]:
    opening, begin = _opening(failure), failure.begin
    if not opening or begin is None or failure.mark[0] == begin[0]:
        return
    first, last = failure.line(begin[0]), failure.line(failure.mark[0])
    if not last.strip() or indent(last) <= indent(first) or first.rstrip()[-1:] not in (",", opening):
        end = failure.above(failure.mark[0]) + 1
        yield Slip(*begin, f"'{opening}' is not closed", f"add '{_CLOSING[opening]}' at the end of line {end}")


def wrong_kind(failure: Failure) -> Iterator[Slip]:
    opening, sign = _opening(failure), failure.here[:1]
    if opening and sign and sign in "}]":
        message = f"'{sign}' closes what '{opening}' opened"
        yield Slip(*failure.mark, message, f"write '{_CLOSING[opening]}'")


def no_comma(failure: Failure) -> Iterator[Slip]:
    if not _opening(failure):
        return
    word = _LAST_WORD.search(failure.before) if failure.here.startswith(":") else None
    if word and ";" in word["gap"]:
        column = word.start("gap") + word["gap"].index(";")
        yield Slip(failure.mark[0], column, f"';' stands before '{word['key']}', expected a comma", "write ','")
    elif word:
        message = f"a comma is missing before '{word['key']}'"
        yield Slip(failure.mark[0], word.start("key"), message, "entries within brackets are separated by commas")
    elif failure.before.endswith("$") and (found := _PLACEHOLDER.match(failure.here)):
        column, text = failure.mark[1] - 1, f"${found[0]}"
        message = f"'{text}' within brackets needs quotes, as braces mean something else in YAML"
        yield Slip(failure.mark[0], column, message, f'write "{text}"')
    elif failure.here.strip():
        message = "a comma is missing, or the text needs quotes"
        yield Slip(*failure.mark, message, "entries within brackets are separated by commas")


def no_value(failure: Failure) -> Iterator[Slip]:
    found = re.search(r"[\w.-]+$", failure.before)
    if "unexpected ':'" in failure.problem and found:
        message = f"nothing stands behind the colon of '{found[0]}'"
        hint = f"write '{found[0]}: value', with a space after the colon"
        if re.search(r"\[[^\[\]{}]*$", failure.before):
            hint = f'if the colon belongs to the text, quote it: "{found[0]}:"'
        yield Slip(failure.mark[0], found.start(), message, hint)
    elif "node content" in failure.problem and failure.here.startswith(","):
        yield Slip(*failure.mark, "nothing stands before this comma", "remove it")
