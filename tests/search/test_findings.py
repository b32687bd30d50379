"""What drives say: rates with intervals, influences and reasons."""

from dataclasses import replace

import pytest

from dodo_dsl.search.findings import find, interval, is_alike, kind_of
from dodo_dsl.search.store import Drive
from tests.search.test_space import space

SPACE = space(
    "{x: {from: 0 m, to: 9 m, nominal: 0 m}, m: {among: [a, b, c], nominal: b}, n: {from: 0, to: 9, nominal: 1}}"
)


def drive(number: int, x: str, m: str, outcome: str, margin: float | None, reason: str = "") -> Drive:
    return Drive(number, {"x": x, "m": m, "n": "1"}, outcome, margin, reason)


def test_the_interval_is_clopper_and_pearsons() -> None:
    """Of 10 with none failed, it ends where (1 - p)^10 = 2.5 %; R's binom.test(3, 20) gives the other."""
    assert interval(0, 10) == pytest.approx((0.0, 1 - 0.025**0.1))
    assert interval(3, 20) == pytest.approx((0.03207094, 0.37892683), abs=1e-7)
    assert interval(0, 0) == (0.0, 1.0)


def test_findings() -> None:
    drives = [
        drive(1, "1 m", "a", "passed", 0.9),
        drive(2, "300 cm", "b", "passed", 0.5),
        drive(3, "5 m", "c", "failed", -0.1, "hit wall after 3.25 s"),
        drive(4, "7 m", "c", "failed", -0.4, "hit wall after 2 s"),
        drive(5, "2 m", "a", "error", None, "service 'track' ended"),
        drive(6, "8 m", "c", "failed", -0.5, "did not answer frame 12"),
    ]
    found = find("t", 3, SPACE, None, drives)
    assert (found.judged, found.failed, found.errors, found.rate) == (5, 3, 1, 0.6)
    assert (found.low, found.high) == interval(3, 5)
    influences = {one.name: one.correlation for one in found.influences}
    assert influences["x"] == pytest.approx(-1.0)
    assert influences.keys() == {"x", "n"} and influences["n"] == 0.0
    assert found.worst == drives[5]
    assert [(failure.kind, failure.drives, failure.worst.number) for failure in found.failures] == [
        ("hit wall after # s", 2, 4),
        ("did not answer frame #", 1, 6),
    ]
    assert [failure.kind for failure in found.left_out] == ["service 'track' ended"]


def test_nothing_judged() -> None:
    found = find("t", 3, SPACE, None, [drive(1, "1 m", "a", "error", None, "x")])
    assert (found.rate, found.worst, found.low, found.high) == (None, None, 0.0, 1.0)


def test_reasons_differ_by_words_only() -> None:
    assert kind_of("hit left at (-1.25, 3) after 7 s") == "hit left at (#, #) after # s"


def test_the_same_failed_checks_make_drives_alike() -> None:
    """The reason decides only where no check failed, as of a crash."""
    left, right = (drive(1, "1 m", "a", "failed", -0.1, f"hit wall {side} after 2 s") for side in ("left", "right"))
    assert not is_alike(left, right)
    left, right = (replace(one, checks="to-goal,wall-margin") for one in (left, right))
    assert is_alike(left, right)
    assert not is_alike(left, replace(right, outcome="passed"))
    assert not is_alike(left, replace(left, checks="to-goal"))
    assert is_alike(left, replace(left, checks="")), "of a version that did not keep them"
    assert not is_alike(left, replace(right, checks=""))
    crash = drive(2, "1 m", "a", "failed", -1.0, "'steering' ended with exit code 1 after 3 s")
    assert is_alike(crash, replace(crash, reason="'steering' ended with exit code 1 after 4 s"))
    assert not is_alike(crash, left) and not is_alike(left, crash)
