"""CSV tables: names in a header, and rows of numbers below it. All that is read from tables is read here."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, NoReturn

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.numbers import number

TIME, VALUE = "time", "value"
_LATEST = 2**52
"""Microseconds; beyond it they are not exact as numbers of 64 bits."""


class Row(NamedTuple):
    line: int
    text: str
    cells: list[str]


class Table:
    """A table of two rows or more; blank lines and those that begin with # are left out.

    If it has a column ``time``, times increase by at least a microsecond from row to row.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        rows = list(self._read())
        if not rows:
            raise InputError(path, "the table is empty, expected a header such as 'time,x,y', and rows")
        self._header, self.rows = rows[0], rows[1:]
        self.names = self._header.cells
        if len(self.names) == 1 and ";" in self._header.text:
            self.fail(self._header, 0, "semicolons between the columns, expected commas, and decimals with a point")
        if len(self.rows) < 2:
            self.fail(rows[-1], 0, f"expected at least 2 rows below the header, found {len(self.rows)}")
        for row in self.rows:
            if len(row.cells) != len(self.names):
                what = f"{len(row.cells)} values, expected {len(self.names)}: {', '.join(self.names)}"
                self.fail(row, 0, what, "decimals have a point: 0.25, and not 0,25")
        self.times = self._increasing() if TIME in self.names else []
        """Microseconds of each row."""

    def numbers(self, name: str) -> list[float]:
        at, found = self.names.index(name), list[float]()
        if self.names.count(name) > 1:
            self.fail(self._header, at, f"the column '{name}' appears twice")
        for row in self.rows:
            value = _number(row.cells[at])
            if value is None or not math.isfinite(value):
                self.fail(row, at, f"{name}: '{row.cells[at]}' is not a finite number")
            found.append(value)
        return found

    def lacks(self, expected: str) -> NoReturn:
        self.fail(self._header, 0, f"expected a header with {expected}, found {', '.join(self.names)}")

    def fail(self, row: Row, column: int, what: str, hint: str = "") -> NoReturn:
        before = row.text.split(",")[:column]
        raise InputError(self.path, what, line=row.line, column=sum(len(each) + 1 for each in before) + 1, hint=hint)

    def _read(self) -> Iterator[Row]:
        try:
            text = regular_file.text(self.path)
        except OSError as error:
            raise InputError(self.path, f"cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise InputError(self.path, "not UTF-8 text, expected a table") from None
        for line, written in enumerate(text.splitlines(), 1):
            if written.strip() and not written.lstrip().startswith("#"):
                try:
                    yield Row(line, written, [cell.strip() for cell in next(csv.reader([written], strict=True))])
                except csv.Error as error:
                    raise InputError(self.path, str(error), line=line, column=1) from None

    def _increasing(self) -> list[int]:
        at, found = self.names.index(TIME), list[int]()
        for row, seconds in zip(self.rows, self.numbers(TIME), strict=True):
            if abs(seconds * MICROSECONDS) > _LATEST:
                self.fail(row, at, f"the time '{row.cells[at]}' is out of range")
            time = round(seconds * MICROSECONDS)
            if found and time <= found[-1]:
                what = f"the time '{row.cells[at]}' is not after {found[-1] / MICROSECONDS:g} s, that of the row before"
                self.fail(row, at, what, "times increase from row to row, by a microsecond at least")
            found.append(time)
        return found


def _number(text: str) -> float | None:
    try:
        return number(text)
    except ValueError:
        return None


def read_target(path: Path, field: str) -> list[tuple[int, float]]:
    """Times in us and values in a table: those of the column ``field``, or else ``value``; raises InputError."""
    table = Table(path)
    name = next((name for name in (field, VALUE) if name in table.names and name != TIME), None)
    if TIME not in table.names or name is None:
        table.lacks(f"the columns {TIME} and {field} (or {VALUE})")
    return list(zip(table.times, table.numbers(name), strict=True))
