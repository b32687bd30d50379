import base64
import json
import math
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.base import Flags, Share, UnjudgeableError, Verdict
from services.base.flags import load_manifest
from services.base.service import SINGLE
from services.continuous_signal import model
from services.continuous_signal.measures import SignalLimits, measure
from services.continuous_signal.model import SignalEvaluator
from services.continuous_signal.target import Target
from tests.services.built import hide
from tests.services.process import ROOT

SECOND = 1_000_000
BEGIN = 7_000 * SECOND
MANIFEST = load_manifest(ROOT / "services" / "continuous_signal")
RAMP = Target(np.array([0, 10 * SECOND]), np.array([0.0, 1.0]))
SIGNAL = "groundSteering of opendlv.proxy.GroundSteeringRequest/0"
samples = st.lists(st.tuples(st.integers(-2 * SECOND, 12 * SECOND), st.floats(-5, 5)), max_size=40)


def limits(exact: float = 0.0, **given: Any) -> SignalLimits:
    """Those given, with ``start`` for ``from``, and few others."""
    usual = dict.fromkeys(MANIFEST["parameters"])
    usual |= {"from": 0.0, "hold": 0.5, "start-up": 0.0, "max-delay": 1.0, "max-time": 60.0, "min-samples": 1}
    renamed = {"from" if name == "start" else name.replace("_", "-"): value for name, value in given.items()}
    return SignalLimits(Flags({**usual, **renamed}), exact)


def judge(limits: SignalLimits, target: Target | None = RAMP, from_begin: bool = True) -> SignalEvaluator:
    it = SignalEvaluator(SIGNAL, target, limits, from_begin)
    it.update(BEGIN - SECOND)
    it.begin(BEGIN)
    return it


def hear(it: SignalEvaluator, *heard: tuple[float, float], delay: float = 0.0) -> None:
    for time, value in heard:
        it.arrived = BEGIN + round((time + delay) * SECOND)
        it.take(value, BEGIN + round(time * SECOND))


def decided(it: SignalEvaluator, seconds: float = 10.0) -> Verdict:
    it.end_of_input(BEGIN + round(seconds * SECOND))
    assert it.verdict is not None
    return it.verdict


def values(verdict: Verdict) -> dict[str, float | None]:
    return {check.name: check.value for check in verdict.checks}


@given(samples, st.floats(0, 3))
def test_the_measures_are_those_of_the_thesis(heard: list[tuple[int, float]], band: float) -> None:
    """Equations 4.6 to 4.9 in numpy and plain Python, on a target that is time itself over 10 s."""
    times, signal = np.array([t for t, _ in heard], np.int64), np.array([v for _, v in heard])
    found = measure(RAMP, times, signal, limits(band=band))
    d = [abs(v - t / (10 * SECOND)) for t, v in heard if 0 <= t <= 10 * SECOND]
    assert (found.received, found.samples) == (sum(t >= 0 for t, _ in heard), len(d))
    assert found.outside == sum(t > 10 * SECOND for t, _ in heard)
    if not d:
        assert (found.mean, found.std, found.distance, found.share, found.worst) == (None,) * 5
        assert (found.mean_over_time, found.std_over_time) == (None, None)
        return
    assert found.mean == pytest.approx(math.fsum(d) / len(d))
    assert found.std == pytest.approx(
        math.sqrt(math.fsum((x - math.fsum(d) / len(d)) ** 2 for x in d) / len(d)), abs=1e-9
    )
    assert found.distance == pytest.approx(max(d))
    worst = found.worst
    assert worst is not None and abs(worst.value - worst.target) == found.distance


@given(samples, st.floats(0, 3), st.integers(1, 15 * SECOND))
@pytest.mark.thorough
def test_time_is_judged_as_its_held(heard: list[tuple[int, float]], band: float, hold: int) -> None:
    """Against numpy on a grid: every 10 ms has the distance of the sample that holds then, or none."""
    step = SECOND // 100
    heard = sorted({round(t, -4): v for t, v in heard}.items())
    hold = max(step, round(hold, -4))
    times, signal = np.array([t for t, _ in heard], np.int64), np.array([v for _, v in heard])
    found = measure(RAMP, times, signal, limits(band=band, hold=hold / SECOND))
    grid = np.arange(0, 10 * SECOND, step)
    inside = (times >= 0) & (times <= 10 * SECOND)
    times, d = times[inside], np.abs(signal - RAMP.at(times))[inside]
    last = np.searchsorted(times, grid, side="right") - 1
    held = (last >= 0) & (grid - times[last] < hold) if len(times) else np.zeros(len(grid), bool)
    assert found.coverage is not None and found.coverage.share == pytest.approx(held.mean())
    if held.any():
        of_time = d[last[held]]
        assert found.mean_over_time == pytest.approx(of_time.mean())
        assert found.std_over_time == pytest.approx(np.std(of_time), abs=1e-6)
        assert found.share == pytest.approx((of_time <= band).mean())
    edges = np.array([0, *times, 10 * SECOND]) / SECOND
    assert found.coverage.gap == pytest.approx(np.diff(edges).max())
    assert found.coverage.gap_begin in edges and found.coverage.gap_end in edges


def test_a_signal_on_its_target_passes() -> None:
    it = judge(limits(max_mean=0.1, max_std=0.1, max_distance=0.2, band=0.1, min_share=0.75, min_samples=4, hold=5))
    hear(it, (0, 0), (2.5, 0.25), (5, 0.625), (7.5, 0.75))
    assert decided(it) == Verdict("passed", (
        f"{SIGNAL} kept to its target over 4 samples: mean 0.03125 (at most 0.1), std 0.05413 (at most 0.1), "
        "distance 0.125 (at most 0.2), share 0.75 (at least 0.75); worst at 5.00 s: 0.625 with a target of 0.5"
    ), decided(it).checks, evidence={
        "time": 5.0, "value": 0.625, "target": 0.5, "gap-begin": 0.0, "gap-end": 2.5,
    })  # fmt: skip
    assert values(decided(it)) == {
        "mean": 0.03125, "std": pytest.approx(0.0541266), "distance": 0.125, "share": 0.75, "samples": 4, "outside": 0,
        "mean-over-time": 0.03125, "std-over-time": pytest.approx(0.0541266), "broken": 0, "late": 0,
        "gap": 2.5, "coverage": 1.0,
    }  # fmt: skip
    assert all(check.ok for check in decided(it).checks)


def test_every_limit_that_is_broken_is_named_with_the_worst_sample() -> None:
    it = judge(limits(max_mean=0.1, max_std=0.1, max_distance=0.2, band=0.1, min_share=0.9))
    hear(it, (0, 0), (5, -0.5))
    assert decided(it).outcome == "failed"
    assert decided(it).reason == (
        "the mean distance is 0.5 (at most 0.1); the standard deviation is 0.5 (at most 0.1); "
        "the largest distance is 1 (at most 0.2); the share of time within 0.1 of the target is 0.5 (at least 0.9); "
        "worst at 5.00 s: -0.5 with a target of 0.5"
    )
    oks = {check.name: check.ok for check in decided(it).checks}
    over_time = ["mean-over-time", "std-over-time"]
    assert [name for name, ok in oks.items() if not ok] == ["mean", "std", "distance", *over_time, "share"]


def test_an_application_that_falls_silent_fails() -> None:
    """A good start does not make up for silence, however many samples it has."""
    it = judge(limits(max_mean=0.01, min_coverage=0.9, max_gap=1))
    hear(it, *((step / 50, step / 500) for step in range(100)))
    assert decided(it).outcome == "failed"
    assert decided(it).reason.startswith(
        "nothing came between 1.98 s and 10.00 s (at most 1 s); "
        "the samples cover 0.248 of the time from 0.00 s to 10.00 s (at least 0.9); worst at "
    )
    assert (values(decided(it))["gap"], values(decided(it))["mean"]) == (8.02, pytest.approx(0))


@pytest.mark.parametrize(("first", "outcome"), [(2.0, "passed"), (2.1, "failed")])
def test_the_application_may_start_slowly(first: float, outcome: str) -> None:
    it = judge(limits(max_mean=1.0, min_coverage=1.0, max_gap=1, start_up=2))
    hear(it, *((time, time / 10) for time in np.arange(first, 10, 0.1)))
    assert decided(it).outcome == outcome
    if outcome == "failed":
        assert decided(it).reason.startswith("nothing came between 0.00 s and 2.10 s (at most 1 s)")


def test_samples_in_a_burst_do_not_hide_bad_time() -> None:
    """A thousand good samples within a second, and a few bad ones afterwards."""
    heard = [*((0.5 + step / 2000, 0.05 + step / 20_000) for step in range(1000)), *((s, 2.0) for s in range(2, 10))]
    it = judge(limits(max_mean=0.1, hold=1))
    hear(it, *heard)
    assert values(decided(it))["mean"] < 0.1  # type: ignore[operator]
    assert decided(it).outcome == "failed" and decided(it).reason.startswith("the mean distance over time is 1.")


def test_a_sample_is_not_believed_far_from_its_arrival() -> None:
    """Neither the future nor a hole can be answered."""
    it = judge(limits(max_mean=1.0, min_coverage=0.5, max_delay=1))
    for arrival, time in ((0.5, 0.5), (1.0, 9.0), (9.0, 3.0), (9.5, 9.4)):
        it.arrived = BEGIN + round(arrival * SECOND)
        it.take(time / 10, BEGIN + round(time * SECOND))
    assert (values(decided(it))["samples"], values(decided(it))["late"]) == (2, 2)
    assert decided(it).reason.endswith(
        "; left out: 2 samples whose time is not that of the arrival, the first of 9.00 s, which came at 1.00 s"
    )


def test_with_sample_times_of_their_own_nobody_stays_where_it_is_easy() -> None:
    """Not even when time is over before the input ends."""
    limited = limits(max_mean=1.0, min_coverage=0.9, max_time=9)
    it = judge(limited, Target(RAMP.times, RAMP.values, 500 * SECOND), from_begin=False)
    for step in range(90):
        it.arrived = BEGIN + step * SECOND // 10
        it.take(0.2, 502 * SECOND + step % 9 * SECOND // 10)
    it.update(BEGIN + 9 * SECOND + 1)
    assert it.verdict is not None and it.verdict.outcome == "failed"
    assert "the samples cover " in it.verdict.reason


@pytest.mark.parametrize(
    ("limited", "seconds", "text"),
    [
        (limits(max_mean=1.0, start=12), 20, "judged is from 12.00 s"),
        (limits(max_mean=1.0, start=5, until=8), 4,
         "judged is from 5.00 s until 8.00 s, and the test ended after 4.00 s"),
    ],
)  # fmt: skip
def test_a_window_without_a_target_is_the_fault_of_the_test(limited: SignalLimits, seconds: int, text: str) -> None:
    with pytest.raises(UnjudgeableError) as raised:
        decided(judge(limited), seconds)
    assert str(raised.value) == f"no time to judge: the target is from 0.00 s to 10.00 s, {text}"


def test_no_sample_is_never_a_pass() -> None:
    verdict = decided(judge(limits(max_mean=9.0)), 12.5)
    assert (verdict.outcome, verdict.reason) == (
        "failed",
        f"no sample of {SIGNAL} came before the input ended after 12.50 s",
    )
    assert values(verdict)["mean"] is None and not verdict.checks[0].ok


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_sample_that_is_no_number_fails(value: float) -> None:
    it = judge(limits(max_mean=9.0))
    hear(it, (4, 0.4), (7, value), (5, value))
    assert decided(it).reason.startswith("2 samples are not finite numbers, the first at 5.00 s; worst at 4.00 s")
    it = judge(limits(max_mean=9.0))
    hear(it, (7, value))
    assert decided(it).reason == f"{SIGNAL} was not a finite number in its one sample, first at 7.00 s"


def test_a_live_target_is_interpolated_when_all_is_there() -> None:
    it = judge(limits(max_mean=0.0, max_distance=0.0), target=None)
    hear(it, (1, 0.125), (4, 0.5), (9, 9.0))
    for time, value in ((8, 1.0), (0, 0.0), (2, 0.25)):
        it.take_target(value, BEGIN + time * SECOND)
    assert values(decided(it)) | {"samples": 2, "outside": 1, "distance": 0.0} == values(decided(it))


def test_without_a_live_target_there_is_no_verdict() -> None:
    it = judge(limits(max_mean=0.0), target=None)
    hear(it, (1, 0.1))
    with pytest.raises(UnjudgeableError, match=r"^no sample of the target came before the input ended after 3.00 s$"):
        it.end_of_input(BEGIN + 3 * SECOND)
    with pytest.raises(UnjudgeableError, match=r"^a sample of the target is nan, expected a finite number$"):
        it.take_target(math.nan, BEGIN)


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model, "MOST_IN_MEMORY", 3)
    it = judge(limits(max_mean=1e-9, min_samples=1))
    hear(it, (1, 0.1), (2, 0.2), (3, 0.3))
    it.update(BEGIN + 4 * SECOND)
    assert it.verdict is not None and it.verdict.outcome == "passed"


def recorded(it: SignalEvaluator) -> dict[str, tuple[list[float], list[float], list[int]]]:
    """Times in s of the test, values and marks of samples and target."""
    it.record()
    found = {}
    for line in map(json.loads, it.judged.lines({})):
        if "times" in line:
            times, numbers = (array("f", base64.b64decode(line[key])).tolist() for key in ("times", "values"))
            seconds = [(line["zero"] - BEGIN) / SECOND + time for time in times]
            found["samples" if "samples" in line else "target"] = (
                [round(each, 3) for each in seconds],
                [round(each, 3) for each in numbers],
                list(base64.b64decode(line["marks"])),
            )
    return found


def test_what_is_recorded_is_marked_as_it_was_judged() -> None:
    """By the target at its time, and in the window alone."""
    it = judge(limits(max_distance=0.3, band=0.1, start=1, min_samples=1))
    hear(it, (5, 0.9), (0.5, 3.0), (2, 0.2), (3, 0.45), (4, math.nan), (11, 0.5))
    decided(it)
    found = recorded(it)
    assert found["target"][:2] == ([0, 10], [0, 1])
    times, values, marks = found["samples"]
    assert (times, marks) == ([0.5, 2, 3, 4, 5, 11], [0, 0, 1, 2, 2, 0])
    assert values[:3] == [3.0, 0.2, 0.45]


def shares(verdict: Verdict) -> dict[str, float | None]:
    return {name: value for name, value in values(verdict).items() if name.endswith("share")}


def test_a_band_may_be_a_share_of_the_target_with_a_floor() -> None:
    """Inside are 1.25 times the target, and 0.05 where that is more: at 0 s and at 1 s, but not at 8 s."""
    given = {"band": Share(0.25), "band_floor": 0.05, "min_share": 0.5, "hold": 1}
    it = judge(limits(**given, min_frame_share=0.75))
    hear(it, (0, 0.05), (1, 0.05), (4, 0.5), (8, 1.01))
    assert shares(decided(it)) == {"share": 0.75, "frame-share": 0.75}
    assert decided(it).outcome == "passed"
    it = judge(limits(**given, min_frame_share=0.8))
    hear(it, (0, 0.06), (1, 0.05), (4, 0.5), (8, 1.01))
    assert decided(it).reason.startswith(
        "the share of frames within 25 % or 0.05 of the target is 0.5 (at least 0.8); worst at"
    )


def test_a_frame_without_a_sample_is_outside_of_the_band_and_has_no_sign() -> None:
    frames = np.arange(0, 10 * SECOND, SECOND)
    limited = limits(band=Share(0.25), band_floor=0.15, min_frame_share=0.8, min_sign_share=0.9)
    it = SignalEvaluator(SIGNAL, RAMP, limited, True, frames)
    it.begin(BEGIN)
    hear(it, *((step, step / 10 * (-1 if step == 1 else 1)) for step in range(8)))
    assert shares(decided(it)) == {"share": 0.875, "frame-share": 0.7, "sign-share": 0.75}
    assert "is 0.7 (at least 0.8), and 2 had no sample; the share of frames with the sign of the" in decided(it).reason


def test_a_target_without_a_sign_is_an_error_of_the_test() -> None:
    it = judge(limits(band_floor=2.0, min_sign_share=0.5))
    hear(it, (1, 0.1))
    with pytest.raises(UnjudgeableError, match=r"^the target is nowhere farther than 2 from 0: it has no sign$"):
        decided(it)


def test_nothing_has_to_be_held_while_no_frame_is_shown() -> None:
    """Samples at 10 Hz from 4 s to 6 s and from 8 s on; nothing was shown before 4 s and from 6 s to 8 s."""
    limited = limits(min_coverage=1.0, max_gap=0.1, hold=0.1)
    heard = [(step / 10, step / 100) for step in (*range(40, 60), *range(80, 101))]
    for is_told, expected in ((True, ("passed", 1.0, 0.1)), (False, ("failed", 0.4, 4.0))):
        it = judge(limited)
        for begin, end in ((0, 1), (1, 4), (6, 7), (7, 8)) if is_told else ():
            hide(it, BEGIN + begin * SECOND, BEGIN + end * SECOND)
        hear(it, *heard)
        verdict = decided(it)
        found = values(verdict)
        assert (verdict.outcome, found["coverage"], found["gap"]) == (expected[0], *map(pytest.approx, expected[1:]))
    it = judge(limited)
    hide(it, BEGIN, BEGIN + 90 * SECOND)
    hear(it, (1, 0.1))
    with pytest.raises(UnjudgeableError, match="no frame was shown"):
        decided(it)


def test_frames_are_counted_where_samples_have_times_of_their_own() -> None:
    """Of 40 frames of 10 Hz 10 are answered, at any time; the target has its sign in all but the first."""
    it = SignalEvaluator(SIGNAL, RAMP, limits(band=1.0, min_frame_share=0.5, min_sign_share=0.5), True,
                         np.arange(0, 10 * SECOND, SECOND // 10), is_copied=False)  # fmt: skip
    it.begin(BEGIN)
    hear(it, *[(step * 0.37, 1.0) for step in range(10)])
    verdict = decided(it, 4)
    assert values(verdict)["frame-share"] == pytest.approx(10 / 39)
    assert values(verdict)["sign-share"] == pytest.approx(9 / 37, abs=0.02)
    assert "29 had no sample" in verdict.reason


@pytest.mark.parametrize(
    ("value", "delay", "notes"),
    [
        (lambda _: 0.5, 0.0, ["all 101 samples of {} have the same value, 0.5"]),
        (lambda time: abs(time - 3) / 10, 0.0, []),
        (lambda time: abs(time - 0.3 - 3) / 10, 0.0, ["{} follows its target 0.30 s late, and no max-lag is set"]),
        (lambda time: abs(time - 3) / 10, 0.3, ["samples of {} came 0.30 s after their time (median)"]),
    ],
)
def test_a_verdict_is_noted_that_says_nothing_of_a_blind_or_late_signal(
    value: Callable[[float], float], delay: float, notes: list[str]
) -> None:
    target = Target(np.array([0, 3 * SECOND, 10 * SECOND]), np.array([0.3, 0.0, 0.7]))
    it = judge(limits(max_distance=0.65, max_delay=1), target)
    for step in range(101):
        hear(it, (step / 10, value(step / 10)), delay=delay)
    decided(it)
    assert it.notes == [each.format(SIGNAL) for each in notes]


def test_limits_that_0_keeps_are_noted() -> None:
    it = judge(limits(max_distance=1.0))
    hear(it, *((step / 10, step / 100) for step in range(101)))
    assert decided(it).outcome == "passed"
    assert it.notes == ["a signal that is always 0 keeps all limits, too"]


@pytest.mark.parametrize(("sent", "is_kept"), [(0.3, True), (0.29999998, True), (0.30000004, False)])
@pytest.mark.parametrize("limit", [{"max_mean": 0.3}, {"max_distance": 0.3}, {"band": 0.3, "min_frame_share": 1.0}])
def test_singles_are_compared_by_what_they_are_exact_to(limit: dict[str, float], sent: float, is_kept: bool) -> None:
    it = judge(limits(exact=SINGLE, **limit), Target(np.array([0, 10 * SECOND]), np.zeros(2)))
    hear(it, *[(step / 10, float(np.float32(sent))) for step in range(101)])
    verdict = decided(it)
    assert (verdict.outcome == "passed") == is_kept
    if sent == 0.3 and "band" not in limit:
        assert values(verdict)[next(iter(limit)).removeprefix("max_")] == 0.3


def test_times_of_another_clock_are_told_by_their_date() -> None:
    it = judge(limits(max_delay=1))
    it.arrived = BEGIN
    it.take(0.5, 1_746_700_000_000_000)
    assert (
        "but 1 sample with times of 2025-05-08, which are not the test's; if they are a recording's"
        in decided(it).reason
    )


def test_samples_beyond_a_short_target_are_noted() -> None:
    it = judge(limits(max_distance=0.5), Target(np.array([0, 2 * SECOND]), np.array([0.0, 0.8])))
    hear(it, *((step / 10, min(0.04 * step, 0.8)) for step in range(61)))
    assert decided(it).outcome == "passed"
    assert f"40 of 61 samples of {SIGNAL} are not judged, as the target is from 0.00 s to 2.00 s alone" in it.notes
