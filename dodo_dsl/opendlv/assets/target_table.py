"""A target from a CSV table: a column `time` in seconds and one of values, a header above them."""

import csv
import difflib
import io
from collections.abc import Iterator, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.numbers import exact

TIME, VALUE = "time", "value"
MICROSECONDS = 1_000_000
LATEST = Decimal(2**52) / MICROSECONDS  # seconds; beyond it microseconds are not exact


class TargetError(ValueError):
    """A target that cannot be used; the message names file and position."""


def read(path: Path, field: str) -> list[tuple[int, float]]:
    """Times in microseconds and values in a table: the column named `field`, or else `value`. Raises TargetError."""
    try:
        rows = csv.reader(io.StringIO(regular_file.text(path), newline=""))
        columns = _columns(next(rows, []), field, path)
        samples = list(_samples(rows, columns, path))
    except (OSError, UnicodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise TargetError(f"{path}: cannot be read as a CSV table: {reason}") from None
    if len(samples) < 2:
        raise TargetError(f"{path}: expected at least 2 rows below the header, found {len(samples)}")
    return samples


def misspelt(path: Path, field: str) -> Iterator[InputError]:
    """Columns of a table that nothing reads: they are almost spelt like the one of `field`; the table is read."""
    header = next(csv.reader(io.StringIO(regular_file.text(path), newline="")), [])
    names = [name.strip() for name in header]
    for close in difflib.get_close_matches(field, names, cutoff=0.75) if field not in names else ():
        if close not in (TIME, VALUE):
            what = f"nothing reads the column '{close}', as the values are those of '{VALUE}'"
            column = ",".join(header).find(close) + 1
            yield InputError(path, what, line=1, column=column, hint=f"did you mean '{field}'?", is_slip=True)


def _columns(header: Sequence[str], field: str, path: Path) -> tuple[int, int, int]:
    """The columns of time and value, and the number of columns."""
    names = [name.strip() for name in header]
    value = next((name for name in (field, VALUE) if name in names and name != TIME), None)
    if TIME not in names or value is None:
        found = ", ".join(names) or "nothing"
        raise TargetError(
            f"{path}:1: expected a header with the columns {TIME} and {field} (or {VALUE}), found {found}"
        )
    return names.index(TIME), names.index(value), len(names)


def _samples(rows: Iterator[list[str]], columns: tuple[int, int, int], path: Path) -> Iterator[tuple[int, float]]:
    time_at, value_at, width = columns
    last: Decimal | None = None
    for number, row in enumerate(rows, 2):
        place = f"{path}:{number}"
        if not row:
            continue
        if len(row) != width:
            raise TargetError(f"{place}: has {len(row)} columns, expected {width} as in the header")
        time, value = _number(row[time_at], f"{place}: the time"), _number(row[value_at], f"{place}: the value")
        if abs(time) > LATEST:
            raise TargetError(f"{place}: the time {time} s is out of range")
        if last is not None and _micros(time) <= _micros(last):
            what = f"the time {time} s appears twice" if time == last else f"the time {time} s comes after {last} s"
            raise TargetError(f"{place}: {what}, expected times that increase by at least a microsecond")
        last = time
        yield _micros(time), float(value)


def _number(text: str, what: str) -> Decimal:
    try:
        number = exact(text.strip())
    except (InvalidOperation, ValueError):
        raise TargetError(f"{what} '{text.strip()}' is not a number") from None
    if not number.is_finite() or abs(float(number)) == float("inf"):
        raise TargetError(f"{what} '{text.strip()}' is not a finite number")
    return number


def _micros(seconds: Decimal) -> int:
    return round(seconds * MICROSECONDS)
