"""Memory over time, and how it grows."""

import random

import pytest

from dodo_dsl.outcome import ServiceUse
from dodo_dsl.run.machine_load.meter import FIRST_PERIOD_S, MOST_PERIOD_S, UseMeter, growth, period_s, test_time
from dodo_dsl.run.machine_load.service_use import Used

test_time.__test__ = False  # type: ignore[attr-defined]
MB = 1e6
TIMES = [0.1 * n for n in range(60)]


def noise(size: float) -> float:
    return random.Random(size).uniform(-0.3 * MB, 0.3 * MB)


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ([100 * MB + 5 * MB * t for t in TIMES], 5 * MB),
        ([100 * MB + 5 * MB * t + noise(t) for t in TIMES], pytest.approx(5 * MB, rel=0.05)),
        ([100 * MB + 50 * MB * (n // 5) for n in range(60)], pytest.approx(100 * MB, rel=0.1)),
        ([100 * MB + (900 * MB if n in (33, 50) else 0) + 5 * MB * t for n, t in enumerate(TIMES)], 5 * MB),
        ([100 * MB + noise(t) for t in TIMES], 0.0),
        ([100 * MB + 0.2 * MB * t for t in TIMES], 0.0),
        ([100 * MB + min(t, 2.5) * 80 * MB for t in TIMES], 0.0),
        ([100 * MB + (200 * MB if t > 4.4 else 0) for t in TIMES], 0.0),
        ([100 * MB + (200 * MB if t > 5.5 else 0) for t in TIMES], 0.0),
        ([300 * MB - 5 * MB * t for t in TIMES], 0.0),
    ],
    ids=["leak", "noisy", "stairs", "spikes", "quiet", "small", "warms-up", "once", "at-the-end", "falls"],
)
def test_growth(sizes: list[float], expected: float) -> None:
    found = growth(list(zip(TIMES, sizes, strict=True)))
    assert found == (pytest.approx(expected) if isinstance(expected, float) else expected)


def test_a_test_that_stands_still_counts_by_its_time() -> None:
    """As in lockstep, where the last answer does not come for two seconds."""
    drive = [(0.1 * n, 100 * MB + n * 20 * MB) for n in range(11)]
    assert growth([*[(0.0, MB)] * 50, *drive, *[drive[-1]] * 200]) == pytest.approx(200 * MB)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_too_short_to_tell(count: int) -> None:
    assert growth([(float(n), n * 50 * MB) for n in range(count)]) is None


@pytest.mark.parametrize(("count", "expected"), [(7, None), (8, pytest.approx(5 * MB))])
def test_between_two_times_of_a_clock_in_steps_nobody_knows(count: int, expected: float | None) -> None:
    """As in lockstep, where ten pictures pass in a quarter of a second: a step then stands still for two."""
    points = [(t, 100 * MB + 5 * MB * t) for t in TIMES]
    half = TIMES[len(TIMES) // 2 :]
    known = [0.0, 1.0, *(half[0] + n * (half[-1] - half[0]) / (count - 1) for n in range(count))]
    assert growth(points, [round(at_s, 6) for at_s in known]) == expected


def test_a_few_frames_tell() -> None:
    assert growth([(0.1 * n, n * 50 * MB) for n in range(6)]) == pytest.approx(500 * MB)
    assert growth([(1.0, n * 50 * MB) for n in range(6)]) is None, "no time has passed"


def test_a_long_test_is_looked_at_less_often() -> None:
    assert [period_s(t) for t in (0.0, 1.0, 1000.0)] == [FIRST_PERIOD_S, FIRST_PERIOD_S, MOST_PERIOD_S]


PROGRESS = [(10.0, 0.0), (11.0, 3.0), (12.0, 3.0)]


@pytest.mark.parametrize(("at_s", "expected"), [(9.0, 0.0), (10.0, 0.0), (10.5, 1.5), (11.5, 3.0), (20.0, 3.0)])
def test_the_time_that_a_test_had_reached(at_s: float, expected: float) -> None:
    assert test_time(PROGRESS, at_s) == expected
    assert test_time([], at_s) == 0.0


async def nothing() -> None:
    return None


def test_figures_are_by_the_test_s_own_time() -> None:
    """Ten times as fast as the wall: half of a processor by its time is a twentieth by the test's."""
    meter = UseMeter(nothing, lambda: 0.0)
    for n in range(5000):
        seconds = 0.002 * n
        size = 900 * MB if n == 777 else 100 * MB + 10 * MB * seconds
        meter.add(50.0 + seconds, {"a": Used(3.0 + 0.5 * seconds, int(size), 2_000_000_000)})
    meter.add(60.0, {"a": Used(8.0, 0, 2_000_000_000)})
    (use,) = meter.figures([(50.0, 0.0), (60.0, 100.0)])
    expected = ServiceUse("a", 5.0, pytest.approx(0.05), 900_000_000, pytest.approx(MB, rel=0.01), 2_000_000_000)
    assert use == expected
    assert UseMeter(nothing, lambda: 0.0).figures([]) == ()


def test_a_service_that_ended_has_grown_until_then() -> None:
    meter = UseMeter(nothing, lambda: 0.0)
    for n in range(100):
        meter.add(0.1 * n, {"a": Used(0.0, n * 1_000_000 if n < 50 else 0), "b": Used(0.0, 7)})
    first, second = meter.figures([(0.0, 0.0), (10.0, 10.0)])
    assert (first.memory_growth_bytes_per_s, first.memory_limit_bytes) == (pytest.approx(10 * MB), None)
    assert (second.service, second.memory_growth_bytes_per_s) == ("b", 0.0)
