"""CSV tables: names in a header, and rows of numbers below it. All that is read from tables is read here."""

import csv
import difflib
from collections.abc import Iterator, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple, NoReturn

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.numbers import exact

TIME, VALUE = "time", "value"
_LATEST = 2**52
"""Microseconds; beyond it they are not exact as numbers of 64 bits."""
_LEAST = 2
_HEADER = "for example 'time,x,y'"


class Row(NamedTuple):
    """A line from 1, its text, and its cells."""

    line: int
    text: str
    cells: list[str]

    def column(self, number: int) -> int:
        """Where a cell begins in the text, from 1; the start of a line with quoted cells."""
        before = self.text.split(",")
        if len(before) != len(self.cells):
            return 1
        return (
            sum(len(each) + 1 for each in before[:number]) + self.text.split(",")[number].find(self.cells[number]) + 1
        )


class Table:
    """A table of two rows or more; blank lines and those that begin with # are left out.

    If it has a column ``time``, times increase by at least a microsecond from row to row.
    """

    def __init__(self, path: Path) -> None:
        """Raises InputError."""
        self.path = path
        rows = list(self._read())
        if not rows:
            raise InputError(path, "the table is empty, expected a header and rows", hint=_HEADER)
        self._header, self.rows = rows[0], rows[1:]
        self.names = self._header.cells
        if len(self.names) == 1 and ";" in self._header.text:
            what = "semicolons between the columns, expected commas, and decimals with a point"
            column = self._header.text.index(";") + 1
            raise InputError(path, what, line=self._header.line, column=column, hint="save the table anew like that")
        if all(_number(cell) is not None for cell in self.names):
            self.fail(self._header, 0, "the table has no header", _HEADER)
        if len(self.rows) < _LEAST:
            what = f"expected at least {_LEAST} rows below the header, found {len(self.rows)}"
            self.fail(rows[-1], 0, what, "save the whole table")
        for row in self.rows:
            if len(row.cells) != len(self.names):
                what = f"{len(row.cells)} values, expected {len(self.names)}: {', '.join(self.names)}"
                self.fail(row, 0, what, "decimals have a point: 0.25, and not 0,25")
        self.times = self._increasing() if TIME in self.names else []
        """Microseconds of each row."""

    def numbers(self, name: str) -> list[Decimal]:
        """The finite numbers in a column; raises InputError."""
        at = self.names.index(name)
        if self.names.count(name) > 1:
            self.fail(self._header, at, f"the column '{name}' appears twice")
        return [self._number(row, at) for row in self.rows]

    def misspelt(self, known: Sequence[str]) -> Iterator[InputError]:
        """Columns with none of these names, but almost one of them."""
        for at, name in enumerate(self.names):
            if name not in known and (close := difflib.get_close_matches(name.lower(), known, 1, cutoff=0.75)):
                what = f"unknown column '{name}', did you mean '{close[0]}'?"
                column = self._header.column(at)
                yield InputError(self.path, what, line=self._header.line, column=column, is_slip=True)

    def lacks(self, expected: str) -> NoReturn:
        """Raises InputError for a header without what was expected."""
        self.fail(self._header, 0, f"expected a header with {expected}, found {', '.join(self.names)}")

    def fail(self, row: Row, column: int, what: str, hint: str = "") -> NoReturn:
        """Raises InputError for a cell."""
        raise InputError(self.path, what, line=row.line, column=row.column(column), hint=hint)

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

    def _number(self, row: Row, at: int) -> Decimal:
        number = _number(row.cells[at])
        if number is None or not number.is_finite() or abs(float(number)) == float("inf"):
            self.fail(row, at, f"{self.names[at]}: '{row.cells[at]}' is not a finite number")
        return number

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


def _number(text: str) -> Decimal | None:
    try:
        return exact(text)
    except (InvalidOperation, ValueError):
        return None


def read_target(path: Path, field: str) -> list[tuple[int, float]]:
    """Times in us and values in a table: those of the column ``field``, or else ``value``; raises InputError."""
    table = Table(path)
    name = next((name for name in (field, VALUE) if name in table.names and name != TIME), None)
    if TIME not in table.names or name is None:
        table.lacks(f"the columns {TIME} and {field} (or {VALUE})")
    return list(zip(table.times, map(float, table.numbers(name)), strict=True))


def misspelt(path: Path, field: str) -> Iterator[InputError]:
    """Columns of a sound table that are almost spelt like ``field``, where the values are those of ``value``."""
    table = Table(path)
    if field not in table.names:
        yield from (each for each in table.misspelt([field, TIME, VALUE]) if f"'{field}'" in each.what)
