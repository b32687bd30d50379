"""What is wrong with a CSV table whichever service reads it: its columns and rows, and its times."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.inputs.problem import InputError
from dodo_dsl.opendlv.numbers import number

_TIME = "time"
_LEAST = 2

Row = tuple[int, str, list[str]]
"""A line from 1, its text, and its cells."""


def problem_in(path: Path) -> InputError | None:
    """The first problem; None where each reader has to say what is wrong, and for what is no text."""
    try:
        rows = list(_rows(regular_file.text(path, encoding="utf-8-sig")))
    except (OSError, ValueError, csv.Error):
        return None
    if not rows:
        return InputError(path, "the table is empty, expected a header and rows", hint="for example 'time,x,y'")
    line, text, header = rows[0]
    if len(header) == 1 and ";" in text:
        what = "semicolons between the columns, expected commas, and decimals with a point"
        hint = "save the table anew with ',' between the columns and '.' in numbers"
        return InputError(path, what, line=line, column=text.index(";") + 1, hint=hint)
    if all(_is_number(cell) for cell in header):
        return InputError(path, "the table has no header", line=line, column=1, hint="for example 'time,x,y'")
    if len(rows) <= _LEAST:
        what = f"expected at least {_LEAST} rows below the header, found {len(rows) - 1}"
        return InputError(path, what, line=rows[-1][0], column=1, hint="save the whole table")
    return _width(path, header, rows[1:]) or _times(path, header, rows[1:])


def _rows(text: str) -> Iterator[Row]:
    for line, written in enumerate(text.splitlines(), 1):
        if written.strip() and not written.lstrip().startswith("#"):
            yield line, written, [cell.strip() for cell in next(csv.reader([written], strict=True))]


def _width(path: Path, header: Sequence[str], rows: Sequence[Row]) -> InputError | None:
    for line, text, cells in rows:
        if len(cells) != len(header):
            what = f"{len(cells)} values, expected {len(header)}: {', '.join(header)}"
            more = len(cells) > len(header) and ";" not in text
            hint = "decimals have a point: 0.25, and not 0,25" if more else "write one value for each column"
            return InputError(path, what, line=line, column=1, hint=hint)
    return None


def _times(path: Path, header: Sequence[str], rows: Sequence[Row]) -> InputError | None:
    at = header.index(_TIME) if _TIME in header else -1
    before: float | None = None
    for line, text, cells in rows if at >= 0 else ():
        if not _is_number(cells[at]):
            return None
        time = number(cells[at])
        if before is not None and time <= before:
            what = f"the time '{cells[at]}' is not after {before:g} s, the time of the row before"
            column = text.find(cells[at]) + 1 if at == 0 else 1
            return InputError(path, what, line=line, column=column, hint="times increase from row to row")
        before = time
    return None


def _is_number(cell: str) -> bool:
    try:
        number(cell)
    except ValueError:
        return False
    return True
