"""A problem of a file that a test names, with its position in that file."""

import re
from json.decoder import JSONDecoder
from pathlib import Path

from dodo_dsl.opendlv import regular_file

_STEP = re.compile(r"\[([0-9]+)\]|([^.\[\]$]+)")
_BLANK = re.compile(r"[ \t\n\r]*")


class InputError(ValueError):
    """A file that cannot be used; as a string one sentence with the file, the position in it and what was expected.

    ``where`` is a path in a JSON document, such as ``$.model[0].color``; in other text there is a line, and perhaps a
    column, from 1. With ``is_slip`` the file can be used, but hardly means what is written. With ``is_of_key`` the key
    at ``where`` is wrong.
    """

    def __init__(
        self,
        file: Path,
        what: str,
        where: str = "",
        line: int = 0,
        column: int = 0,
        hint: str = "",
        is_slip: bool = False,
        is_of_key: bool = False,
    ) -> None:
        self.file, self.where, self.hint, self.is_slip = file, where, hint, is_slip
        self.what = f"{where}: {what}" if where else what
        self._line, self._column, self._is_of_key = line, column, is_of_key
        numbers = "".join(f":{number}" for number in (line, column) if number)
        super().__init__(f"{file}{numbers}: {self.what}")

    def position(self) -> tuple[int, int]:
        """Line and column in the file, from 1; the file is read again for a position in JSON."""
        if self.where and not self._line:
            try:
                text = regular_file.text(self.file)
                return json_position(text, self.where, self._is_of_key)
            except (OSError, ValueError, RecursionError):
                return 1, 1
        return self._line or 1, self._column or 1


def json_position(text: str, where: str, is_of_key: bool = False) -> tuple[int, int]:
    """Line and column of a path in a JSON document, or of its key.

    If the document ends before, that of what is around it.
    """
    at, decoder = _skip(text, 0), JSONDecoder()
    key = at
    for match in _STEP.finditer(where):
        begin, inner = (
            (at, _item(text, at, int(match[1]), decoder)) if match[1] else _member(text, at, match[2], decoder)
        )
        if inner is None:
            break
        key, at = begin, inner
    at = key if is_of_key else at
    return text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)


def _skip(text: str, at: int) -> int:
    match = _BLANK.match(text, at)
    return match.end() if match else at


def _member(text: str, at: int, key: str, decoder: JSONDecoder) -> tuple[int, int | None]:
    """Where a key and its value begin; of equal keys the last counts."""
    begin, found, at = at, None, _skip(text, at + 1) if text[at] == "{" else len(text)
    while at < len(text) and text[at] == '"':
        here = at
        name, at = decoder.raw_decode(text, at)
        at = _skip(text, _skip(text, at) + 1)
        begin, found = (here, at) if name == key else (begin, found)
        at = _behind(text, at, decoder)
    return begin, found


def _item(text: str, at: int, index: int, decoder: JSONDecoder) -> int | None:
    at = _skip(text, at + 1) if text[at] == "[" else len(text)
    for _ in range(index):
        if at >= len(text) or text[at] == "]":
            return None
        at = _behind(text, at, decoder)
    return at if at < len(text) and text[at] != "]" else None


def _behind(text: str, at: int, decoder: JSONDecoder) -> int:
    """Behind a value and its comma."""
    at = _skip(text, decoder.raw_decode(text, at)[1])
    return _skip(text, at + 1) if text[at : at + 1] == "," else at
