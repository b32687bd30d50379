"""Slips with quotation marks."""

import re
from collections.abc import Iterator

import yaml

from dodo_dsl.slips.failure import Failure, Slip

QUOTES = ("'", '"')
_KEY_LINE = re.compile(r"^\s*(?:- )?[\w.-]+:(?:\s|$)", re.MULTILINE)


def unclosed(failure: Failure) -> Iterator[Slip]:
    """Also where the next quotation mark, lines below, closes it."""
    begin = failure.begin if "quoted scalar" in failure.context else None
    if begin is None or "escape" in failure.problem:
        begin = next((_start(token) for token in failure.tokens if _swallows_keys(failure, token)), None)
    if begin:
        line = failure.line(begin[0])
        quote = line[begin[1] : begin[1] + 1]
        yield Slip(*begin, "this quotation mark is not closed in its line", f"add {quote} at the end of the text")


def _start(token: yaml.Token) -> tuple[int, int]:
    return token.start_mark.line, token.start_mark.column


def _swallows_keys(failure: Failure, token: yaml.Token) -> bool:
    """Whether a text in quotation marks goes over lines that look like keys."""
    if (
        not isinstance(token, yaml.ScalarToken)
        or token.style not in QUOTES
        or token.start_mark.line == token.end_mark.line
    ):
        return False
    inner = failure.lines[token.start_mark.line + 1 : token.end_mark.line + 1]
    return any(_KEY_LINE.match(line) for line in inner)


def text_behind(failure: Failure) -> Iterator[Slip]:
    """Text behind the closing quotation mark, which is often an apostrophe."""
    quote = failure.before.rstrip()[-1:]
    if "did not find expected" not in failure.problem or quote not in QUOTES or not failure.here.strip():
        return
    if failure.here[0] in ",]}:":
        return
    if quote == "'" and failure.here[0].isalpha() and failure.before.endswith("'"):
        message = "this apostrophe ends the text, which is in single quotes"
        yield Slip(failure.mark[0], failure.mark[1] - 1, message, "write the text in double quotes")
    else:
        yield Slip(*failure.mark, "text stands behind the closing quotation mark", "put the whole text in quotes")


def escape(failure: Failure) -> Iterator[Slip]:
    if "escape" in failure.problem and "quoted scalar" in failure.context:
        message = f"'{failure.here[:2]}' means nothing within double quotes"
        yield Slip(*failure.mark, message, "write the text in single quotes, where a backslash is a backslash")
