"""The open documents of an editor, and positions in their texts.

YAML counts lines and columns, an editor lines and code units.
"""

import bisect
import re
from dataclasses import dataclass
from pathlib import Path

from lsprotocol.types import Position, Range
from pygls.uris import from_fs_path, to_fs_path
from pygls.workspace import PositionCodec, Workspace

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import MAX_BYTES


@dataclass(frozen=True)
class Document:
    """An open document with its resolved path; ``version`` counts its changes."""

    uri: str
    path: Path
    text: str
    version: int | None


def path_of(uri: str) -> Path | None:
    """The resolved path of a file's URI; None for anything else, such as a document that has no file yet."""
    text = to_fs_path(uri)
    try:
        return Path(text).resolve() if text else None
    except (OSError, RuntimeError, ValueError):
        return None


def uri_of(path: Path) -> str:
    return from_fs_path(str(path)) or path.as_uri()


def opened(workspace: Workspace) -> dict[Path, Document]:
    """The open documents that are files."""
    found = {}
    for uri, document in list(workspace.text_documents.items()):
        path = path_of(uri)
        if path is not None:
            found[path] = Document(uri, path, document.source, document.version)
    return found


def saved_text(path: Path) -> str:
    """The text of a file that is not open, as far as positions need it."""
    try:
        if not path.is_file():  # a FIFO would never end
            return ""
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES).decode("utf-8", "replace")
    except OSError:
        return ""


_EDITOR_BREAK = re.compile(r"\r\n|[\n\r]")
_YAML_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
_BOM = "\ufeff"


class Lines:
    """The lines of a text. YAML breaks them at characters, too, at which editors do not."""

    def __init__(self, text: str, codec: PositionCodec) -> None:
        self.text = text.removeprefix(_BOM)
        self._codec = codec
        self._starts = _starts(_EDITOR_BREAK, self.text)
        self._yaml_starts = _starts(_YAML_BREAK, self.text)

    def range(self, span: Span) -> Range:
        """The range of a span, as far as the text has it; it ends in the line in which it begins."""
        start = self.offset(span.line, span.column)
        end = min(start + span.length, self._end(bisect.bisect_right(self._starts, start) - 1))
        return Range(self.position(start), self.position(max(start, end)))

    def offset(self, line: int, column: int) -> int:
        """The index in the text of a line and column that count from 1."""
        if line > len(self._yaml_starts):
            return len(self.text)
        return min(self._yaml_starts[line - 1] + column - 1, len(self.text))

    def position(self, offset: int) -> Position:
        line = bisect.bisect_right(self._starts, offset) - 1
        before = self.text[self._starts[line] : min(offset, self._end(line))]
        return Position(line, self._codec.client_num_units(before))

    def index(self, position: Position) -> int:
        """The index in the text of an editor's position; that of the line's end where the line is shorter."""
        if position.line >= len(self._starts):
            return len(self.text)
        start, end = self._starts[position.line], self._end(position.line)
        units = 0
        for index in range(start, end):
            if units >= position.character:
                return index
            units += self._codec.client_num_units(self.text[index])
        return end

    def _end(self, line: int) -> int:
        """The index of a line's break."""
        next_start = self._starts[line + 1] if line + 1 < len(self._starts) else len(self.text)
        return self._starts[line] + len(self.text[self._starts[line] : next_start].rstrip("\r\n"))


def _starts(line_break: re.Pattern[str], text: str) -> list[int]:
    return [0, *(found.end() for found in line_break.finditer(text))]
