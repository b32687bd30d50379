"""Way points from a CSV table or a list."""

import csv
import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.inputs.trajectory import Point, TrajectoryError
from dodo_dsl.opendlv.numbers import number

NEEDED, POSSIBLE = ("x", "y"), ("x", "y", "z", "yaw", "time")


def read_table(path: Path, height: float) -> list[Point]:
    """The way points of a CSV file with a header; ``height`` (m) counts where there is no column z.

    Columns x, y and z in m, yaw in rad, time in s; other columns are ignored, as are blank lines and those that begin
    with #. Raises TrajectoryError with file and line.
    """
    try:
        text = regular_file.text(path, encoding="utf-8-sig")
    except OSError as error:
        raise TrajectoryError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise TrajectoryError(f"{path} is not UTF-8 text, expected a table with the columns x and y") from None
    lines = [(f"{path}:{number}", line) for number, line in enumerate(text.splitlines(), 1)]
    rows = [(place, _cells(place, line)) for place, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise TrajectoryError(f"{path} is empty, expected a header with the columns x and y, and way points")
    columns = _columns(*rows[0])
    return [_point(place, columns, cells, height) for place, cells in rows[1:]]


def read_points(texts: Iterable[str], height: float) -> list[Point]:
    """Way points written as ``x y``, in m, at ``height``; raises TrajectoryError."""
    return [_written(text, height) for text in texts]


def _cells(place: str, line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], strict=True))]
    except csv.Error as error:
        raise TrajectoryError(f"{place}: {error}") from None


def _columns(place: str, cells: Sequence[str]) -> list[str]:
    for name in cells:
        close = difflib.get_close_matches(name.lower(), POSSIBLE, 1, cutoff=0.75)
        if close and name not in POSSIBLE:
            raise TrajectoryError(f"{place}: unknown column '{name}', did you mean '{close[0]}'?")
        if name in POSSIBLE and cells.count(name) > 1:
            raise TrajectoryError(f"{place}: the column '{name}' appears twice")
    missing = [name for name in NEEDED if name not in cells]
    if missing:
        raise TrajectoryError(f"{place}: the column '{missing[0]}' is missing")
    return list(cells)


def _point(place: str, columns: Sequence[str], cells: Sequence[str], height: float) -> Point:
    if len(cells) != len(columns):
        raise TrajectoryError(f"{place}: {len(cells)} values, expected {len(columns)}: {', '.join(columns)}")
    values = {
        name: _number(f"{place}: {name}", text) for name, text in zip(columns, cells, strict=True) if name in POSSIBLE
    }
    return _from(place, values, height)


def _written(text: str, height: float) -> Point:
    words = text.split()
    if len(words) != len(NEEDED):
        raise TrajectoryError(f"the point '{text}' has {len(words)} numbers, expected x and y in m, such as '2 0.5'")
    place = f"the point '{text}'"
    return _from(place, {name: _number(place, word) for name, word in zip(NEEDED, words, strict=True)}, height)


def _from(place: str, values: Mapping[str, float], height: float) -> Point:
    return Point(place, values["x"], values["y"], values.get("z", height), values.get("yaw"), values.get("time"))


def _number(what: str, text: str) -> float:
    try:
        value = number(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TrajectoryError(f"{what}: '{text}' is not a finite number")
    return value
