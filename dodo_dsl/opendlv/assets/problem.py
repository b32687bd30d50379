"""A problem of a file that a test names, with its position in that file."""

import re
from pathlib import Path

from dodo_dsl.opendlv import regular_file

_STEP = re.compile(r"\[([0-9]+)\]|([^.\[\]$]+)")
_TOKEN = re.compile(r'"((?:[^"\\]|\\.)*)"|[\[\]{},:]|[^\s\[\]{},:"]+')


class InputError(ValueError):
    """A file that cannot be used; as a string one sentence with the file, the position in it and what was expected.

    ``where`` is a path in a JSON document, such as ``$.model[0].color``; in other text there is a line, and perhaps a
    column, from 1. With ``is_slip`` the file can be used, but hardly means what is written.
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
    ) -> None:
        self.file, self.where, self.hint, self.is_slip = file, where, hint, is_slip
        self.what = f"{where}: {what}" if where else what
        self._line, self._column = line, column
        numbers = "".join(f":{number}" for number in (line, column) if number)
        super().__init__(f"{file}{numbers}: {self.what}")

    def position(self) -> tuple[int, int]:
        """Line and column in the file, from 1; the file is read again for a position in JSON."""
        if self.where and not self._line:
            try:
                return json_position(regular_file.text(self.file), self.where)
            except (OSError, ValueError):
                return 1, 1
        return self._line or 1, self._column or 1


def json_position(text: str, where: str) -> tuple[int, int]:
    """Line and column of a path in a JSON document, or of what is around it if the document ends before.

    That of an object's member is its value's; of equal keys the last counts.
    """
    wanted = [int(index) if index else key for index, key in _STEP.findall(where)]
    path: list[int | str] = []
    best, found, key = 0, 0, ""
    for token in _TOKEN.finditer(text):
        sign = token[0]
        if sign in ("]", "}"):
            path.pop()
        elif sign == "," and path:
            path[-1] = path[-1] + 1 if isinstance(path[-1], int) else ""
        elif sign == ":" and path:
            path[-1] = key
        elif sign != ",":
            if path == wanted[: len(path)] and len(path) >= best:
                best, found = len(path), token.start()
            key = token[1] or ""
            if sign in ("[", "{"):
                path.append(0 if sign == "[" else "")
    return text.count("\n", 0, found) + 1, found - text.rfind("\n", 0, found)
