import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.run.rigs.axis_calibration import AXES, AxisLine, CalibrationProblem, Reading, ReadingOff, fit

X, YAW = AXES["x"], AXES["yaw"]
PLACES = (-0.7, -0.35, 0.0, 0.35, 0.7)


def readings(steps: float, offset: float, places: "tuple[float, ...]" = PLACES) -> list[Reading]:
    return [Reading(steps * place + offset, place) for place in places]


def off_by(index: int, error: float) -> list[Reading]:
    found = readings(3320, 2988)
    found[index] = Reading(found[index].steps, found[index].place + error)
    return found


@given(st.floats(3000, 3600), st.floats(2700, 3300))
@pytest.mark.thorough
def test_exact_readings_give_the_constants(steps: float, offset: float) -> None:
    line = fit(X, readings(steps, offset))
    assert (line.steps, line.offset) == pytest.approx((steps, offset), rel=1e-9)
    assert line.place(steps * 0.5 + offset) == pytest.approx(0.5)


def test_standard_errors_are_the_spread_of_repeated_measurements() -> None:
    chance = random.Random(1)
    lines: list[AxisLine] = []
    for _ in range(300):
        lines.append(fit(X, [Reading(r.steps, r.place + chance.gauss(0, 0.0002)) for r in readings(3223, 2965)]))
    for name in ("steps", "offset"):
        values = [getattr(line, name) for line in lines]
        middle = math.fsum(values) / len(values)
        spread = math.sqrt(math.fsum((value - middle) ** 2 for value in values) / len(values))
        errors = math.sqrt(math.fsum(getattr(line, f"{name}_error") ** 2 for line in lines) / len(lines))
        assert spread == pytest.approx(errors, rel=0.15), name


@pytest.mark.parametrize("index", range(5))
@pytest.mark.parametrize("error", [0.01, -0.5])
def test_the_reading_that_is_off_is_named(index: int, error: float) -> None:
    with pytest.raises(ReadingOff, match=rf"x: reading {index + 1}, .* off the line of the others, and 1.00 mm") as off:
        fit(X, off_by(index, error))
    assert off.value.index == index and f"is {1000 * error:+.2f} mm off" in str(off.value)


def test_a_wrong_sign_is_named() -> None:
    found = readings(3320, 2988)
    found[4] = Reading(found[4].steps, -found[4].place)
    with pytest.raises(ReadingOff, match=r"reading 5, -700.00 mm at 5312.00 steps, is -1400.00 mm off"):
        fit(X, found)


def test_several_readings_that_are_off_are_said_as_such() -> None:
    found = [
        Reading(r.steps, r.place + e) for r, e in zip(readings(3320, 2988), (0, 9e-3, 0, 7e-3, -8e-3), strict=True)
    ]
    with pytest.raises(ReadingOff, match="more than one reading is off") as off:
        fit(X, found)
    assert off.value.index is None


def test_a_residual_within_the_tolerance_is_accepted() -> None:
    line = fit(X, off_by(2, 0.0011))
    assert max(map(abs, line.residuals)) == pytest.approx(0.00088)
    assert fit(YAW, readings(0.55, 83, (-100, -50, 0, 50.4))).residuals


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([], "x has 0 readings, expected at least 4"),
        (readings(3320, 2988, (0, 0.05, 0.1, 0.15)), "span 150.00 mm, expected at least 300.00 mm"),
        (readings(3320, 2988, (0, 0, 0.5, 0.5)), "fewer than 4 different counts"),
        (readings(-3320, 2988), "is the sign of the readings wrong"),
    ],
)
def test_readings_that_cannot_tell(found: list[Reading], said: str) -> None:
    with pytest.raises(CalibrationProblem, match=said):
        fit(X, found)
