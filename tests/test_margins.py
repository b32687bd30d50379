"""Margins have the sign of their check, grow with the distance to the limit, and make one number of a test."""

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.outcome import SLOW_ANSWERS, Outcome, with_margin, worst_margin

PASSED = Outcome("t", "t", "t.dodo.yml", "sil", "closed-loop", "passed", "so", 130, 0, "lockstep", "process")
FAILED = replace(PASSED, outcome="failed")
NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**300), 10**300)
LIMITS = st.dictionaries(st.sampled_from(["min", "max"]), NUMBERS)


def check(value: float | None, ok: bool = True, name: str = "mean", **limit: float) -> dict[str, Any]:
    return {"name": name, "value": value, "limit": limit, "unit": "m", "ok": ok}


def margins(*arguments: Any, **limit: float) -> tuple[float | None, float | None]:
    found = with_margin(check(*arguments, **limit))
    return found["margin"], found["margin_share"]


@pytest.mark.parametrize(
    ("value", "limit", "margin", "share"),
    [
        (1.0, {"max": 4.0}, 3.0, 3 / 7),
        (4.0, {"max": 4.0}, 0.0, 0.0),
        (8.0, {"max": 4.0}, -4.0, -1 / 2),
        (0.75, {"min": 0.5}, 0.25, 1 / 3),
        (0.25, {"min": 0.5}, -0.25, -1 / 3),
        (0.25, {"min": 0}, 0.25, 1 / 5),
        (3, {"min": 1, "max": 4}, 1.0, 1 / 2.5),
        (2.5, {"min": 1, "max": 4}, 1.5, 1 / 2),
        (-1, {"min": 1, "max": 4}, -2.0, -2 / 3.5),
        (3, {"min": 2, "max": 2}, -1.0, -1 / 3),
        (-3.0, {"min": -2.0}, -1.0, -1 / 3),
        (None, {"max": 4.0}, None, None),
        (3.0, {}, None, None),
    ],
)
def test_the_distance_to_the_nearest_limit(
    value: float | None, limit: dict[str, float], margin: float | None, share: float | None
) -> None:
    found = margins(value, margin is None or margin >= 0, **limit)
    assert found == (margin, pytest.approx(share) if share is not None else None)


def test_a_check_that_fails_at_its_limit_is_negative() -> None:
    """A wall that is touched is hit, also where no distance has to be kept."""
    assert margins(0.0, False, min=0.0) == (0.0, -1.0)
    assert margins(0.3, False, min=0.2) == (pytest.approx(0.1), -1.0)
    assert margins(5.0, True, max=4.0) == (-1.0, 0.0)


@given(NUMBERS, LIMITS, st.booleans())
def test_the_share_has_the_sign_of_the_check(value: float, limit: dict[str, float], ok: bool) -> None:
    margin, share = margins(value, ok, **limit)
    assert (margin is None) == (share is None) == (not limit)
    if share is not None:
        assert 0 <= share <= 1 if ok else -1 <= share < 0
    json.dumps([margin, share], allow_nan=False)


def outcome(base: Outcome, *checks: dict[str, Any]) -> Outcome:
    return replace(base, checks=tuple(map(with_margin, checks)))


def test_the_worst_of_a_passed_test_is_the_check_with_the_least_to_spare() -> None:
    spare, tight = check(1.0, max=4.0), check(3.0, max=4.0)
    assert worst_margin(outcome(PASSED, spare, tight)) == pytest.approx(1 / 5)
    assert worst_margin(outcome(PASSED, spare, check(3, name="gates", min=3), check(9.0))) == pytest.approx(3 / 7)
    assert worst_margin(outcome(PASSED, spare, check(0.099, name=SLOW_ANSWERS, max=0.1))) == pytest.approx(3 / 7)
    assert worst_margin(outcome(PASSED, check(0, max=0))) == 0.0
    assert worst_margin(PASSED) == 0.0


def test_the_worst_of_a_failed_test_is_negative() -> None:
    late, close = check(None, False, max=40.0), check(0.03, False, min=0.05)
    assert worst_margin(outcome(FAILED, late, close, check(1.0, max=4.0))) == pytest.approx(-2 / 7)
    assert worst_margin(outcome(FAILED, late, check(0.0, False, min=0.0))) == -1.0
    touched, rest = check(0.0, False, min=0.0), check(3.0, False, max=0.0)
    assert worst_margin(outcome(FAILED, late, touched, rest)) == pytest.approx(-3 / 4)
    assert worst_margin(outcome(FAILED, late)) == -1.0
    assert worst_margin(outcome(FAILED, check(1.0, max=4.0))) == -1.0
    assert worst_margin(outcome(FAILED, check(0.5, False, name=SLOW_ANSWERS, max=0.1))) == pytest.approx(-0.8)


def test_an_error_has_no_margin_and_results_of_older_versions_have_none() -> None:
    assert worst_margin(replace(FAILED, outcome="error")) is None
    old = check(3.0, max=4.0)
    assert [worst_margin(replace(base, checks=(old,))) for base in (PASSED, FAILED)] == [0.0, -1.0]
