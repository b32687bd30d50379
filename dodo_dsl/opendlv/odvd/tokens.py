"""The words of a message specification (``.odvd``) with their places; comments and blanks are dropped."""

import re
from collections.abc import Iterator
from typing import NamedTuple


class OdvdError(ValueError):
    """A specification that cannot be used; the text begins with ``file:line:column``."""


class TextPlace(NamedTuple):
    """A place in a file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+|//[^\n]*|/\*.*?\*/)
      | (?P<name>[A-Za-z][A-Za-z0-9_]*(?:\.[A-Za-z][A-Za-z0-9_]*)*)
      | (?P<number>[+-]?[0-9]+(?:\.[0-9]*)?)
      | "(?P<string>[^"]*)"
      | '(?P<char>[^'])'
      | (?P<sign>[\[\]{};=,])""",
    re.VERBOSE | re.DOTALL,
)


class Token(NamedTuple):
    kind: str
    text: str
    place: TextPlace

    def __str__(self) -> str:
        return "the end of the file" if self.kind == "end" else f"'{self.text}'"


def tokens(text: str, file: str) -> Iterator[Token]:
    position, line, line_start = 0, 1, 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            place = TextPlace(file, line, position - line_start + 1)
            raise OdvdError(f"{place}: '{text[position]}' is not allowed here")
        kind = match.lastgroup or ""
        if kind != "space":
            yield Token(kind, match[kind], TextPlace(file, line, position - line_start + 1))
        if newlines := match[0].count("\n"):
            line += newlines
            line_start = match.start() + match[0].rindex("\n") + 1
        position = match.end()
    yield Token("end", "", TextPlace(file, line, position - line_start + 1))
