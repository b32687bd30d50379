"""Text of others on a terminal or in a log of CI: it says what it says, and commands nothing.

Recordings, specs, compose files and applications decide parts of what DoDo prints. A terminal obeys escape sequences,
and the log of CI lines such as ``::error::`` or ``##[error]``.
"""

import json
import re
import shutil
from collections.abc import Iterable
from typing import Any, TextIO, cast

_COMMAND = re.compile(r"^(\s*:)(?=:)", re.MULTILINE)
"""GitHub's: the first characters of a line are two colons."""
_OLD_COMMAND = re.compile(r"#(?=#(\[|vso\[))")
"""GitHub's old ones and those of Azure Pipelines, anywhere in a line."""
_LONGEST = len("##vso")
WIDE = 120
"""Columns of a log or file, which no terminal shows."""
_USUAL = 80
_NARROWEST = 20
_MOST_COLUMNS = 1000


def printable(text: str) -> str:
    """The text as one line without control characters, which could move a cursor or command a CI log."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ("→" if c == "\t" else "�") for c in text)


def columns(stream: TextIO | None = None) -> int:
    """How many columns a line may have: COLUMNS, those of the terminal that standard output is, or usual ones."""
    usual = _USUAL if stream is not None and stream.isatty() else WIDE
    return max(_NARROWEST, min(shutil.get_terminal_size((usual, 0)).columns, _MOST_COLUMNS))


def excerpt(line: str, start: int, length: int, room: int) -> tuple[str, str, str]:
    """The part of a line around a place that fits into so many characters: what is before it, in it and behind it.

    The place begins at character ``start`` and is cut where it is too long; ``…`` stands for what is left out.
    """
    text = printable(line)
    first = max(0, min(start - room // 4, len(text) - room))
    head, tail = "…" * (first > 0), "…" * (first + room < len(text))
    last = first + room - len(tail)
    end = min(start + length, last)
    return head + text[first + len(head) : start], text[start:end], text[end:last] + tail


def harmless(text: str) -> str:
    """Lines that begin at the start of a line, without control characters and commands to a CI log."""
    plain = "".join(c if c.isprintable() or c in "\n\t" else "�" for c in text)
    return _OLD_COMMAND.sub("# ", _COMMAND.sub(r"\1 ", plain))


def json_text(value: Any) -> str:
    """JSON in lines that stay the same in a harmless stream: no character of a command or beyond ASCII is in it."""
    return _OLD_COMMAND.sub(r"\\u0023", json.dumps(value, indent=2)) + "\n"


class HarmlessStream:
    """A stream that writes text as ``harmless`` has it, whatever pieces it comes in."""

    def __init__(self, stream: TextIO) -> None:
        self.unescaped = stream
        self._line = ""
        """The start of the unfinished line: blanks, and a colon at most."""
        self._end = ""
        """The last characters."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unescaped, name)

    def write(self, text: str) -> int:
        size = len(text)
        if any(found.start() < len(self._end) for found in _OLD_COMMAND.finditer(self._end + text)):
            text = f" {text}"
        self._end = (self._end + text)[-_LONGEST:]
        head, self._line = self._line, _begin_of_last_line(self._line + text)
        self.unescaped.write(harmless(head + text)[len(head) :])
        return size

    def writelines(self, lines: Iterable[str]) -> None:
        self.write("".join(lines))


def harmless_stream(stream: TextIO) -> TextIO:
    """The stream, harmless."""
    return stream if isinstance(stream, HarmlessStream) else cast(TextIO, HarmlessStream(stream))


def unescaped(stream: TextIO) -> TextIO:
    """The stream below, for a display that moves the cursor itself and makes its texts ``printable``."""
    return cast(TextIO, getattr(stream, "unescaped", stream))


def _begin_of_last_line(text: str) -> str:
    line = text.rpartition("\n")[2]
    return line if line.strip() in ("", ":") else "."
