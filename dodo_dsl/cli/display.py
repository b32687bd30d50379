"""How commands show things: colours of verdicts and diagnostics, ``-q`` and ``-v``.

Colours are shown on a terminal, or where FORCE_COLOR asks for them, and never with NO_COLOR. The codes are those of
ECMA-48, section 8.3.117 (SGR), in the terminal's own palette.
"""

import os
from collections.abc import Iterable
from enum import IntEnum
from typing import TextIO

from dodo_dsl.diagnostics import Diagnostic, Piece, pieces
from dodo_dsl.terminal import columns, unescaped

_CODES = {
    "passed": "32",
    "failed": "31",
    "error": "1;31",
    "in error": "33",
    "warning": "1;33",
    "not run": "2",
    "hint": "36",
    "mark": "1;31",
    "gutter": "2",
    "place": "1",
}
_RESET = "\x1b[0m"
_WITHOUT_COLOURS = ("dumb", "unknown")
"""Values of TERM."""
OF_OUTCOMES = {"passed": "passed", "failed": "failed", "error": "in error"}
"""The styles of outcomes."""


def commands_terminal(stream: TextIO) -> bool:
    """Whether the stream is a terminal that obeys escape sequences."""
    return stream.isatty() and os.environ.get("TERM") not in _WITHOUT_COLOURS


def are_wanted(stream: TextIO) -> bool:
    """NO_COLOR comes first, then FORCE_COLOR; an empty variable counts as none (no-color.org, force-color.org)."""
    if os.environ.get("NO_COLOR"):
        return False
    return bool(os.environ.get("FORCE_COLOR")) or commands_terminal(stream)


def write_coloured(stream: TextIO, parts: Iterable[Piece]) -> None:
    """Writes the text of all parts, those with a style coloured where that is wanted."""
    if not are_wanted(stream):
        stream.writelines(text for text, _ in parts)
        return
    codes = unescaped(stream)  # a harmless stream shows them instead
    for text, style in parts:
        if not style:
            stream.write(text)
            continue
        codes.write(f"\x1b[{_CODES[style]}m")
        stream.write(text)
        codes.write(_RESET)


def write_diagnostics(stream: TextIO, diagnostics: Iterable[Diagnostic]) -> None:
    """As ``format_text`` has them."""
    width = columns(stream)
    write_coloured(stream, (piece for diagnostic in diagnostics for piece in pieces(diagnostic, width)))


class Verbosity(IntEnum):
    QUIET = -1
    NORMAL = 0
    VERBOSE = 1
