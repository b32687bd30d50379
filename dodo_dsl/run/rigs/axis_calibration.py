"""Calibration of axes: readings as answers, flags and files write them, and the line through those of an axis.

The line has full steps per unit, steps at 0, and how well the readings fit it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Node, Scalar, read
from dodo_dsl.spec import quantity


class CalibrationProblem(Exception):
    """Measurements from which nothing can be computed, or not well enough; one sentence."""


FEWEST = 4
"""Readings of an axis: three that fit show which fourth one does not."""
_DEGREES = 360.0


@dataclass(frozen=True)
class Axis:
    """An axis; places are in ``unit``, read in ``small`` units of which ``per`` make one.

    A residual may have ``tolerance`` (unit), and readings have to span ``span`` (unit). ``turn`` is the number of full
    steps of an axis that turns without end, of which only the offset is measured; 0 of others.
    """

    name: str
    unit: str
    small: str
    per: float
    tolerance: float
    span: float
    turn: float = 0.0

    @property
    def density(self) -> str:
        """The unit of its steps."""
        return f"steps/{self.unit}"

    def shown(self, place: float, sign: str = "") -> str:
        """A place, or a difference of two, as a ruler or protractor shows it."""
        return f"{place * self.per + 0.0:{sign}.2f} {self.small}"


AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        Axis("x", "m", "mm", 1000.0, 0.001, 0.3),
        Axis("y", "m", "mm", 1000.0, 0.001, 0.3),
        Axis("yaw", "deg", "deg", 1.0, 0.5, 60.0),
    )
}

CIRCLE_YAW = Axis("yaw", "deg", "deg", 1.0, 0.5, 60.0, turn=200.0)
"""Of a rig whose yaw turns without end."""


@dataclass(frozen=True)
class Reading:
    """The counters' full steps from home, and the true place that was read (m, degrees)."""

    steps: float
    place: float


@dataclass(frozen=True)
class AxisLine:
    """steps = ``steps`` * place + ``offset``, with standard errors; residuals are read minus computed places."""

    steps: float
    offset: float
    steps_error: float
    offset_error: float
    residuals: tuple[float, ...]

    def place(self, steps: float) -> float:
        """The true place at a count of steps."""
        return (steps - self.offset) / self.steps


class ReadingOff(CalibrationProblem):
    """Readings do not fit a line; ``index`` is the one that the others contradict, None if there are several."""

    def __init__(self, text: str, index: int | None) -> None:
        super().__init__(text)
        self.index = index


def fit(axis: Axis, readings: Sequence[Reading]) -> AxisLine:
    """The line with the least squares of differences between read and computed places.

    Raises CalibrationProblem for readings that are too few or too close, and ReadingOff for a residual beyond the
    axis' tolerance.
    """
    if len(readings) < FEWEST:
        noun = "reading" if len(readings) == 1 else "readings"
        raise CalibrationProblem(f"{axis.name} has {len(readings)} {noun}, expected at least {FEWEST}")
    places = [reading.place for reading in readings]
    if (spread := max(places) - min(places)) < axis.span:
        text = f"the readings of {axis.name} span {axis.shown(spread)}, expected at least {axis.shown(axis.span)}"
        raise CalibrationProblem(text)
    if len({round(reading.steps, 1) for reading in readings}) < FEWEST:
        raise CalibrationProblem(f"the readings of {axis.name} have fewer than {FEWEST} different counts of steps")
    line = _line(axis, readings)
    worst = max(map(abs, line.residuals))
    if worst > axis.tolerance:
        raise _off(axis, readings, worst)
    return line


def _apart(axis: Axis, reading: Reading, line: AxisLine) -> float:
    apart = reading.place - line.place(reading.steps)
    return math.remainder(apart, _DEGREES) if axis.turn else apart


def _line(axis: Axis, readings: Sequence[Reading]) -> AxisLine:
    return _offset(axis.turn / _DEGREES, readings) if axis.turn else _straight(readings)


def _offset(steps: float, readings: Sequence[Reading]) -> AxisLine:
    """The offset where the steps a degree are known; a heading may have any of its names."""
    first, *_ = shifts = [reading.place - reading.steps / steps for reading in readings]
    apart = [math.remainder(shift - first, _DEGREES) for shift in shifts]
    middle = math.fsum(apart) / len(apart)
    residuals = tuple(each - middle for each in apart)
    deviation = math.sqrt(math.fsum(e * e for e in residuals) / max(len(apart) - 1, 1))
    offset = -(first + middle) * steps % (_DEGREES * steps)
    return AxisLine(steps, offset, 0.0, deviation * steps / math.sqrt(len(apart)), residuals)


def _straight(readings: Sequence[Reading]) -> AxisLine:
    count = len(readings)
    middle = math.fsum(r.steps for r in readings) / count
    level = math.fsum(r.place for r in readings) / count
    squares = math.fsum((r.steps - middle) ** 2 for r in readings)
    slope = math.fsum((r.steps - middle) * (r.place - level) for r in readings) / squares
    if slope <= 0:
        raise CalibrationProblem("places fall while steps rise: is the sign of the readings wrong?")
    residuals = tuple(r.place - level - slope * (r.steps - middle) for r in readings)
    deviation = math.sqrt(math.fsum(e * e for e in residuals) / max(count - 2, 1))
    offset = middle - level / slope
    return AxisLine(
        steps=1 / slope,
        offset=offset,
        steps_error=deviation / math.sqrt(squares) / slope**2,
        offset_error=deviation / slope * math.sqrt(1 / count + (offset - middle) ** 2 / squares),
        residuals=residuals,
    )


def _off(axis: Axis, readings: Sequence[Reading], worst: float) -> ReadingOff:
    """The reading without which all others fit best, if they fit then."""
    least, found, by = math.inf, None, 0.0
    for index, reading in enumerate(readings):
        others = [*readings[:index], *readings[index + 1 :]]
        try:
            line = _line(axis, others)
        except (CalibrationProblem, ZeroDivisionError):
            continue
        largest = max(map(abs, line.residuals))
        if largest < least:
            least, found, by = largest, index, _apart(axis, reading, line)
    allowed = f"{axis.shown(axis.tolerance)} are allowed"
    if found is None or least > axis.tolerance:
        text = (
            f"{axis.name}: the readings do not fit a line, the largest residual is {axis.shown(worst)}, and {allowed}"
        )
        return ReadingOff(f"{text}; more than one reading is off, or the axis slips", None)
    reading = readings[found]
    where = f"reading {found + 1}, {axis.shown(reading.place)} at {reading.steps:.2f} steps,"
    return ReadingOff(f"{axis.name}: {where} is {axis.shown(by, '+')} off the line of the others, and {allowed}", found)


STEPS, READS = "steps", "reads"
_EXPECTED = "expected lists of readings by axis, such as 'x: [{steps: 532.1 steps, reads: -740 mm}, ...]'"

Readings = dict[str, list[Reading]]


class ReadingsError(CalibrationProblem):
    """Readings that are not written as they should be; one sentence with the place."""

    usage = True


def place(axis: Axis, text: str) -> float:
    """A place of an axis (m, degrees) as written with its unit; raises ReadingsError."""
    return _quantity(text, axis.unit)


def of_flag(text: str) -> tuple[str, Reading]:
    """The axis and the reading of ``AXIS:STEPS:PLACE``; raises ReadingsError."""
    name, *rest = text.split(":")
    if name not in AXES or len(rest) != 2:
        raise ReadingsError(f"'{text}' is not a reading, expected AXIS:STEPS:PLACE such as x:532.1:-740mm")
    try:
        steps = float(quantity.convert(f"{rest[0].removesuffix(STEPS)} {STEPS}", STEPS))
        return name, Reading(steps, place(AXES[name], rest[1]))
    except (quantity.QuantityError, ReadingsError) as problem:
        raise ReadingsError(f"reading '{text}': {problem}") from None


def of_file(path: Path) -> Readings:
    """The readings of a YAML file; raises ReadingsError."""
    node, problems = read(path)
    if problems:
        raise ReadingsError(f"{path}:{problems[0].span.line}: {problems[0].message}")
    if not isinstance(node, source.Mapping):
        raise ReadingsError(f"{path}: {_EXPECTED}")
    found: Readings = {}
    for name, entry in node.entries.items():
        if name not in AXES or not isinstance(entry.value, source.Sequence):
            raise _wrong(entry.key, f"'{name}': {_EXPECTED}")
        found[name] = [_reading(AXES[name], item) for item in entry.value.items]
    return found


def as_text(readings: Readings) -> str:
    """The readings as such a file."""
    lines = []
    for name, rows in readings.items():
        axis = AXES[name]
        lines.append(f"{name}:")
        for row in rows:
            lines.append(f"  - {{{STEPS}: {row.steps:.4f} steps, {READS}: {row.place * axis.per:.4f} {axis.small}}}")
    return "".join(f"{line}\n" for line in lines)


def _reading(axis: Axis, item: Node) -> Reading:
    if not isinstance(item, source.Mapping) or set(item.entries) != {STEPS, READS}:
        raise _wrong(item.span, f"expected a reading such as {{steps: 532.1 steps, reads: 40 {axis.small}}}")
    return Reading(_number(item.get(STEPS), STEPS), _number(item.get(READS), axis.unit))


def _number(node: Node | None, unit: str) -> float:
    assert node is not None
    if not isinstance(node, Scalar):
        raise _wrong(node.span, f"expected a quantity in {unit}")
    try:
        return _quantity(node.text, unit)
    except ReadingsError as problem:
        raise _wrong(node.span, str(problem)) from None


def _quantity(text: str, unit: str) -> float:
    try:
        return float(quantity.convert(text, unit))
    except quantity.QuantityError as error:
        hint = f"; {error.hint}" if error.hint else ""
        raise ReadingsError(f"{error}{hint}") from None


def _wrong(span: Span, message: str) -> ReadingsError:
    return ReadingsError(f"{span.file}:{span.line}:{span.column}: {message}")
