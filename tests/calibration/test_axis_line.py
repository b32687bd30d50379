import math
import random

import pytest

from dodo_dsl.run.rigs.calibration import CalibrationProblem, Reading, ReadingOff, axes, fit

X, YAW, CIRCLE_YAW = axes(circle=False)["x"], axes(circle=False)["yaw"], axes(circle=True)["yaw"]
PLACES = (-0.7, -0.35, 0.0, 0.35, 0.7)


def readings(steps: float, offset: float, places: "tuple[float, ...]" = PLACES) -> list[Reading]:
    return [Reading(steps * place + offset, place) for place in places]


def off_by(index: int, error: float) -> list[Reading]:
    found = readings(3320, 2988)
    found[index] = Reading(found[index].steps, found[index].position + error)
    return found


def test_standard_errors_are_the_spread_of_repeated_measurements() -> None:
    chance = random.Random(1)
    exact = readings(3223, 2965)
    lines = [fit(X, [Reading(r.steps, r.position + chance.gauss(0, 0.0002)) for r in exact]) for _ in range(300)]
    assert (fit(X, exact).steps, fit(X, exact).offset) == pytest.approx((3223, 2965), rel=1e-9)
    for name in ("steps", "offset"):
        values = [getattr(line, name) for line in lines]
        middle = math.fsum(values) / len(values)
        spread = math.sqrt(math.fsum((value - middle) ** 2 for value in values) / len(values))
        errors = math.sqrt(math.fsum(getattr(line, f"{name}_error") ** 2 for line in lines) / len(lines))
        assert spread == pytest.approx(errors, rel=0.15), name


def test_a_circle_has_an_offset_only_and_a_heading_any_of_its_names() -> None:
    found = [Reading(s, p) for s, p in ((0.0, 175.5), (50.0, -94.5), (100.0, -4.5), (190.0, 517.5))]
    line = fit(CIRCLE_YAW, found)
    assert (line.steps, line.offset) == (pytest.approx(200 / 360), pytest.approx(102.5))
    with pytest.raises(ReadingOff, match=r"yaw: reading 2, .* is \+9\.00 deg off"):
        fit(CIRCLE_YAW, [found[0], Reading(50.0, -85.5), *found[2:]])


@pytest.mark.parametrize("index", range(5))
@pytest.mark.parametrize("error", [0.01, -0.5])
def test_the_reading_that_is_off_is_named(index: int, error: float) -> None:
    with pytest.raises(ReadingOff, match=rf"x: reading {index + 1}, .* off the line of the others, and 1.00 mm") as off:
        fit(X, off_by(index, error))
    assert off.value.index == index and f"is {1000 * error:+.2f} mm off" in str(off.value)


def test_a_residual_within_the_tolerance_is_accepted() -> None:
    line = fit(X, off_by(2, 0.0011))
    assert max(map(abs, line.residuals)) == pytest.approx(0.00088)
    assert len(fit(YAW, readings(0.55, 83, (-100, -50, 0, 50.4))).residuals) == 4


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (readings(3320, 2988, (0, 0.05, 0.1, 0.15)), "span 150.00 mm, expected at least 300.00 mm"),
        (readings(-3320, 2988), "is the sign of the readings wrong"),
        ([*[Reading(5000.0, 0.6)] * 3, Reading(3000.0, 0.0)], "fewer than 4 different places"),
    ],
)
def test_readings_that_cannot_tell(found: list[Reading], said: str) -> None:
    with pytest.raises(CalibrationProblem, match=said):
        fit(X, found)
