"""Places in a text: YAML's lines and columns, and an editor's lines and code units."""

import bisect
import re

from lsprotocol.types import Position, Range
from pygls.workspace import PositionCodec

from dodo_dsl.diagnostics import Span

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

    def whole(self) -> Range:
        return Range(Position(0, 0), self.position(len(self.text)))

    def offset(self, line: int, column: int) -> int:
        """The index in the text of a line and column that count from 1."""
        if line > len(self._yaml_starts):
            return len(self.text)
        return min(self._yaml_starts[line - 1] + column - 1, len(self.text))

    def place(self, position: Position) -> tuple[int, int]:
        """YAML's line and column of an editor's position."""
        offset = self.index(position)
        line = bisect.bisect_right(self._yaml_starts, offset)
        return line, offset - self._yaml_starts[line - 1] + 1

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
