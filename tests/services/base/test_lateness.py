"""How late updates are counted."""

from fractions import Fraction

from services.base.loop import Lateness

PERIOD = 100_000


def test_updates_that_end_late_are_counted_from_the_begin_of_the_test() -> None:
    lateness = Lateness(PERIOD, None)
    lateness.add(0, 90_000)
    assert lateness.news() is None, "the test has not begun"
    lateness.begin()
    lateness.add(PERIOD, PERIOD + 50_000)
    assert lateness.news() is None
    lateness.add(2 * PERIOD, 2 * PERIOD + 50_001)
    assert lateness.news() == {"updates": 2, "late": 1, "worst_s": 0.05}
    assert lateness.news() is None, "it is reported once"
    lateness.add(3 * PERIOD, 3 * PERIOD + 70_000)
    assert lateness.news() == {"updates": 3, "late": 2, "worst_s": 0.07}


def test_updates_that_were_skipped_are_late() -> None:
    lateness = Lateness(Fraction(1_000_000, 60), None)
    lateness.begin()
    lateness.add(0, 0)
    lateness.add(16_667, 16_667)
    lateness.add(1_000_000, 1_000_000)
    assert lateness.news() == {"updates": 61, "late": 58, "worst_s": 0.0}


def test_a_short_period_or_another_limit() -> None:
    for lateness, most in ((Lateness(1000, None), 10_000), (Lateness(1000, 25_000.0), 25_000)):
        lateness.begin()
        lateness.add(0, most)
        assert lateness.news() is None
        lateness.add(1000, 1001 + most)
        assert lateness.news() is not None
