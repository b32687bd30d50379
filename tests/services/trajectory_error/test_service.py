"""What becomes of estimates, whatever the application sends: one sentence, and never a pass without any."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from services.base import UnjudgeableError, Verdict
from tests.services.built import built, hand, hide, refusal

TRUTH, ESTIMATE, S = "opendlv.sim.Frame", "robot.PoseEstimate", 1_000_000
BEGIN = 1_700_000_000 * S
NAN = math.nan
Sample = tuple[float, float, dict[str, float]]
"""Sample time and arrival in s, and the fields."""


def pose(t: float, **other: float) -> dict[str, float]:
    """On a circle of 1 m around the origin, once in 10 s."""
    angle = math.tau * t / 10
    half = (angle + math.pi / 2) / 2
    return {"x": math.cos(angle), "y": math.sin(angle), "qz": math.sin(half), "qw": math.cos(half)} | other


def shifted(t: float) -> dict[str, float]:
    """By 3 cm and 4 cm."""
    right = pose(t)
    return right | {"x": right["x"] + 0.03, "y": right["y"] - 0.04}


def samples(of: Callable[[float], dict[str, float]], rate: int, seconds: float = 5) -> list[Sample]:
    times = [step / rate for step in range(round(seconds * rate) + 1)]
    return [(t, t, of(t)) for t in times]


GOOD, EXACT, FRAMES = samples(shifted, 10), samples(pose, 10), samples(pose, 100)


def decided(
    flags: Sequence[str], estimates: list[Sample], frames: list[Sample] = FRAMES, zero: int = BEGIN, end: int = 5
) -> Verdict:
    """The verdict; sample times count from ``zero``, arrivals from the begin."""
    said = [(arrival, 0, TRUTH, t, fields) for t, arrival, fields in frames]
    said += [(arrival, 1, ESTIMATE, t, fields) for t, arrival, fields in estimates]
    with built("trajectory_error", *flags) as it:
        it.begin(BEGIN)
        for arrival, _, name, t, fields in sorted(said, key=lambda each: each[:2]):
            it.arrived = BEGIN + round(arrival * S)
            hand(it, name, zero + round(t * S), 0, **fields)
        it.end_of_input(BEGIN + end * S)
        assert isinstance(it.verdict, Verdict)
        return it.verdict


def values(verdict: Verdict) -> dict[str, Any]:
    return {check.name: check.value for check in verdict.checks}


def changed(number: int, t: float | None = None, arrival: float | None = None, **fields: float) -> list[Sample]:
    """The good estimates, one of them with another time, arrival or field."""
    time, came, right = GOOD[number]
    return [*GOOD[:number], (time if t is None else t, arrival or came, right | fields), *GOOD[number + 1 :]]


FINE = "passed: 51 estimates kept to the true pose: "
BROKEN = "failed: estimates that are not finite or have no attitude: 1 (at most 0), the first at 2.00 s; farthest"
NONE = "failed: estimates with a true pose: "
ROWS: list[tuple[str, list[Sample], str]] = [
    ("--max-ate=0.0501", GOOD, FINE + "ate 0.05 m (at most 0.0501); farthest"),
    ("--max-ate=0.04", GOOD, "failed: the absolute trajectory error is 0.05 m (at most 0.04); farthest"),
    ("--max-ate=0.05", samples(lambda t: pose(t, z=0.05000001), 10),
     "failed: the absolute trajectory error is 0.05000001 m (at most 0.05)"),
    ("--max-ate=0.1", samples(lambda t: pose(t, x=pose(t)["x"] + 2), 10),
     "failed: the absolute trajectory error is 2 m (at most 0.1); farthest at 0.80 s: 2.000 m and 0.000 deg"),
    ("--max-ate=0.04", [], "failed: no robot.PoseEstimate/0 came before the input ended after 5.00 s"),
    ("--max-ate=1", changed(20, x=NAN), BROKEN),
    ("--max-ate=1", changed(20, x=1e200), BROKEN),
    ("--max-ate=1", changed(20, qz=0, qw=0), BROKEN),
    ("--max-ate=1", changed(20, t=1.9), "failed: estimates with the time of another one: 1 (at most 0), the first"),
    ("--max-ate=1", GOOD[:9], NONE + "9 (at least 10); the longest time without an estimate is 4.2 s (at "),
    ("--max-ate=1 --max-gap=0.5", GOOD[:20] + GOOD[30:], "failed: the longest time without an estimate is 1.1 s (at "),
    ("--max-error=0.1 --max-ate=0.1", changed(20, z=0.5),
     "failed: the largest distance from the true position is 0.5025 m (at most 0.1); farthest at 2.00 s: 0.502 m and "),
    ("--max-rotation=1", samples(lambda t: pose(t) | {"qx": 0.1}, 10),
     "failed: the absolute rotation error is 11.42 deg"),
    ("--max-rpe=0.001", GOOD, FINE + "rpe"),
    ("--max-rpe=1 --delta=100", GOOD, "failed: the relative trajectory error over 100 frames is nothing (at most 1)"),
    ("--max-rpe=0.1 --delta=1 --delta-unit=s", samples(lambda t: pose(t, z=0.2 * t), 10),
     "failed: the relative trajectory error over 1 s is 0.2 m (at most 0.1)"),
    ("--max-rpe-rotation=0.1 --delta=1 --delta-unit=m", samples(lambda t: pose(1.01 * t), 10),
     "failed: the relative rotation error over 1 m is "),
    ("--max-ate=0.001 --align=origin", GOOD, FINE),
    ("--max-ate=1 --align=se3", samples(lambda _: pose(0), 10), "failed: the way of the estimates is straight, which"),
]  # fmt: skip


@pytest.mark.parametrize(("flags", "estimates", "said"), ROWS)
def test_what_becomes_of_estimates(flags: str, estimates: list[Sample], said: str) -> None:
    verdict = decided(flags.split(), estimates)
    assert f"{verdict.outcome}: {verdict.reason}".startswith(said)
    assert verdict.silent is (not estimates) and '"verdict"' in verdict.line()


def test_the_measures_of_a_known_error_and_where_it_is_largest() -> None:
    verdict = decided(["--max-ate=0.1"], changed(7, z=0.12))
    assert values(verdict) == {
        "ate": pytest.approx(math.sqrt(0.05**2 + 0.12**2 / 51)), "mean": pytest.approx((50 * 0.05 + 0.13) / 51),
        "error": pytest.approx(0.13), "rotation": pytest.approx(0, abs=1e-5),
        "rotation-error": pytest.approx(0, abs=1e-5), "rpe": pytest.approx(0.12 * math.sqrt(2 / 50)),
        "rpe-rotation": pytest.approx(0, abs=1e-5), "estimates": 51, "gap": 0.1, "broken": 0, "repeated": 0,
        "unmatched": 0,
    }  # fmt: skip
    x, y = pose(0.7)["x"], pose(0.7)["y"]
    place = {"time": 0.7, "x": x, "y": y, "estimate-x": x + 0.03, "estimate-y": y - 0.04}
    assert verdict.evidence == pytest.approx(place)
    assert values(decided(["--max-ate=1"], changed(5, t=0.55), EXACT))["unmatched"] == 1


def test_what_is_not_shown_is_no_gap() -> None:
    with built("trajectory_error", "--max-ate=1", "--max-gap=0.5") as it:
        it.begin(BEGIN)
        for step in (*range(20), *range(40, 60)):
            it.update(BEGIN + step * S // 10)
            hand(it, TRUTH, BEGIN - 10**15 + step * S // 10, 0, **pose(step))
            hand(it, ESTIMATE, BEGIN - 10**15 + step * S // 10, 0, **pose(step))
        hide(it, BEGIN + 2 * S, BEGIN + 4 * S, sampled=BEGIN + 2 * S - 10**15, sampled_until=BEGIN + 4 * S - 10**15)
        it.end_of_input(BEGIN + 6 * S)
        assert it.verdict.outcome == "passed" and values(it.verdict)["gap"] == 0.1
        assert sum('"samples"' in line and f'"zero": {BEGIN}' in line for line in it.judged.lines({})) == 2


def test_on_the_clock_of_a_recording_it_is_the_same() -> None:
    """Sample times of another year, for truth and estimates."""
    late = changed(20, arrival=4.9)
    assert decided(["--max-ate=1"], late, zero=BEGIN - 10**15) == decided(["--max-ate=1"], late)


@pytest.mark.parametrize(
    ("flags", "frames", "said"),
    [
        ((), [], "no opendlv.sim.Frame of the vehicle came before the input ended after 5.00 s"),
        ((), samples(lambda t: pose(t, x=NAN), 10), "an opendlv.sim.Frame of the vehicle is not finite "),
        ((), [(t + 0.05, t + 0.05, it) for t, _, it in EXACT], "no true pose is within max-diff, 0.01 s, of an"),
        (("--align=se3",), samples(lambda t: pose(0, x=t, y=2 * t), 100), "the true way is straight, which leaves "),
    ],
)  # fmt: skip
def test_without_a_truth_to_judge_by_there_is_no_verdict(flags: Any, frames: list[Sample], said: str) -> None:
    with pytest.raises(UnjudgeableError, match=f"^{said}"):
        decided(["--max-ate=1", *flags], EXACT, frames)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--max-rpe=1", "--delta=0.5"), "--delta=0.5 is not a whole number of frames"),
        (("--max-rpe=1", "--delta-unit=km"), "'km', expected string, one of frames, m, s"),
    ],
)
def test_flags_that_leave_something_open_are_refused(flags: tuple[str, ...], said: str) -> None:
    assert said in refusal("trajectory_error", *flags)
