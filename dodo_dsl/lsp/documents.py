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


_SHOWN, _READ = re.compile(r"\r\n|[\n\r]"), re.compile("\r\n|[\n\r\x85\u2028\u2029]")
"""The breaks of an editor's lines, and of YAML's."""
_BOM = "\ufeff"


class Lines:
    """The lines of a text, in which a span lies in the line where it begins, as far as the text has it."""

    def __init__(self, text: str, codec: PositionCodec) -> None:
        self._text, self._codec = text.removeprefix(_BOM), codec
        self._shown, self._read = ([0, *(b.end() for b in each.finditer(self._text))] for each in (_SHOWN, _READ))
        self._ends = [*(start - 1 for start in self._read[1:]), len(self._text)]

    def range(self, span: Span) -> Range:
        number, line, start, end = self._place(span)
        units = [self._codec.client_num_units(line[:index]) for index in (start, end)]
        return Range(*(Position(number, unit) for unit in units))

    def text(self, span: Span) -> str:
        _, line, start, end = self._place(span)
        return line[start:end]

    def _place(self, span: Span) -> tuple[int, str, int, int]:
        """Number and text of the editor's line, from 0, and between which characters of it the span is."""
        offset = len(self._text)
        if span.line <= len(self._read):
            offset = min(self._read[span.line - 1] + span.column - 1, self._ends[span.line - 1])
        number = bisect.bisect_right(self._shown, offset) - 1
        line = _SHOWN.split(self._text[self._shown[number] :], maxsplit=1)[0]
        start = min(offset - self._shown[number], len(line))
        return number, line, start, min(start + span.length, len(line))
