"""Text of others on a terminal or in a log of CI: it says what it says, and commands nothing.

Recordings, specs, compose files and applications decide parts of what DoDo prints. A terminal obeys escape sequences,
and the log of CI lines such as ``::error::`` or ``##[error]``.
"""

import json
import re
import shutil
import unicodedata
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


def width_of(stream: TextIO) -> int | None:
    """How many columns a line may have on the stream's terminal; None if it is a file or a pipe."""
    return columns(stream) if stream.isatty() else None


def clipped(text: str, width: int | None) -> str:
    """The start of printable text that fits into so many columns, with ``…`` where some is left out."""
    if width is None or cells(text) <= width:
        return text
    return text[: _fitting(text, width - 1)].rstrip() + "…"


def cells(text: str) -> int:
    """How many columns a terminal takes for printable text: none for marks on a letter, two for wide characters."""
    if text.isascii():
        return len(text)
    return sum(_cells(character) for character in text)


def _cells(character: str) -> int:
    if unicodedata.category(character) in ("Mn", "Me"):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def excerpt(line: str, start: int, length: int, room: int) -> tuple[str, str, str]:
    """The part of a line around a place that fits into so many columns: what is before the place, in it and behind it.

    The place begins at character ``start`` and is cut where it is too long; ``…`` stands for what is left out.
    """
    begin, end = max(0, start - room), start + room
    before, behind = printable(line[begin:start]), printable(line[start:end])
    marked = min(length, len(behind))
    if begin == 0 and end >= len(line) and cells(before + behind) <= room:
        return before, behind[:marked], behind[marked:]
    room -= 2  # for what stands for the rest
    least = max(room // 4, (room - cells(behind[:marked])) // 2, room - cells(behind))
    kept = _fitting(before[::-1], least)
    shown = _fitting(behind, room - cells(before[len(before) - kept :]))
    head = "…" if kept < start else ""
    tail = "…" if start + shown < len(line) else ""
    in_place = behind[: min(marked, shown)]
    return head + before[len(before) - kept :], in_place, behind[len(in_place) : shown] + tail


def _fitting(text: str, room: int) -> int:
    """How many characters from the start fit into so many columns."""
    for number, character in enumerate(text):
        room -= _cells(character)
        if room < 0:
            return number
    return len(text)


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
