"""Readings of axes as they are written: in answers, in flags, and in a file."""

from pathlib import Path

from dodo_dsl.calibration.axis_line import AXES, Axis, Reading
from dodo_dsl.calibration.problem import CalibrationProblem
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Mapping, Node, Scalar, Sequence, read
from dodo_dsl.spec import quantity

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
    if not isinstance(node, Mapping):
        raise ReadingsError(f"{path}: {_EXPECTED}")
    found: Readings = {}
    for name, entry in node.entries.items():
        if name not in AXES or not isinstance(entry.value, Sequence):
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
    if not isinstance(item, Mapping) or set(item.entries) != {STEPS, READS}:
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
