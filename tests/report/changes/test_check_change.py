"""The direction of a change follows from the limit, whatever the value does."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.report import comparison
from dodo_dsl.report.comparison import check_change, with_margins


def check(value: float | None, ok: bool | None = None, unit: str = "m", **limit: float) -> dict[str, Any]:
    kept = value is not None and limit.get("min", value) <= value <= limit.get("max", value)
    return {"name": "x", "value": value, "limit": limit, "unit": unit, "ok": kept if ok is None else ok}


CASES = [
    (check(1, max=2), check(1.5, max=2), "worse"),
    (check(1.5, max=2), check(1, max=2), "better"),
    (check(1, min=0.5), check(1.5, min=0.5), "better"),
    (check(1, min=0.5), check(0.6, min=0.5), "worse"),
    (check(1, min=0.5), check(0.4, min=0.5), "worse"),
    (check(0.4, min=0.5), check(0.6, min=0.5), "better"),
    (check(0.1, min=0.5), check(0.4, min=0.5), "better"),
    (check(0.9, min=-1, max=1), check(-0.1, min=-1, max=1), "better"),
    (check(0.9, min=-1, max=1), check(-0.9, min=-1, max=1), "different"),
    (check(1, max=2), check(1.00001, max=2), "unchanged"),
    (check(6.55, max=40), check(6.54, max=40), "unchanged"),
    (check(6.55, max=40), check(6.4, max=40), "better"),
    (check(6.55, max=7), check(6.47, max=7), "better"),
    (check(6.55, max=6.6), check(6.61, max=6.6), "worse"),
    (check(0.0698, min=0), check(0.0697, min=0), "unchanged"),
    (check(480, min=450), check(479, min=450), "worse"),
    (check(5.123), check(5.125), "unchanged"),
    (check(0.1, max=2), check(0.2, max=2), "worse"),
    (check(1), check(2), "different"),
    (check(1), check(1), "unchanged"),
    (check(None, ok=True, max=2), check(1, max=2), "different"),
    (check(1, max=2), check(None, ok=False, max=2), "worse"),
    (check(None, ok=False, max=2), check(None, ok=False, max=2), "unchanged"),
    (check(1, max=2), check(1, max=3), "better"),
    (check(1, max=3), check(2, max=4), "different"),
    (check(1, max=2), check(1000, unit="mm", max=2000), "different"),
    (
        {**check(1, max=2), "margin": 0.3, "margin_share": 0.1},
        {**check(1.5, max=2), "margin": 0.4, "margin_share": 0.2},
        "better",
    ),
    ({**check(1, max=5), "name": "slow-answers"}, {**check(4, max=5), "name": "slow-answers"}, "unchanged"),
    ({**check(1, max=5), "name": "slow-answers"}, {**check(6, max=5), "name": "slow-answers"}, "worse"),
    ({**check(1, max=2), "margin": None, "margin_share": None}, check(1.5, max=2), "different"),
]


@pytest.mark.parametrize(("before", "after", "direction"), CASES)
def test_direction(before: dict[str, Any], after: dict[str, Any], direction: str) -> None:
    assert check_change(before, after, 0).direction == direction


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.sampled_from(["min", "max"]))
def test_turned_round_a_change_has_the_other_direction(was: float, now: float, bound: float, side: str) -> None:
    before, after = check(was, **{side: bound}), check(now, **{side: bound})
    there, back = check_change(before, after, 0), check_change(after, before, 0)
    assert back.direction == {"better": "worse", "worse": "better"}.get(there.direction, there.direction)
    if there.direction == "better":
        assert now > was if side == "min" else now < was


def test_margins_are_those_of_the_results_where_they_have_any() -> None:
    assert with_margins(check(1, min=0, max=3))["margin"] == 1
    assert with_margins({"name": "x", "value": 1, "ok": True})["margin"] is None
    given = {**check(1, max=3), "margin": 7, "margin_share": 0.5}
    assert with_margins(given) == given


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (check(0.12, min=0.03), check(0.05, min=0.03), "0.12 m -> 0.05 m (-0.07 m; limit: at least 0.03 m)"),
        (check(1, unit=""), check(3, unit=""), "1 -> 3 (+2)"),
        (check(1, max=2), check(None, ok=False, max=3), "1 m -> none (limit: at most 3 m, was at most 2 m)"),
        (check(1, max=2), check(900, unit="mm"), "1 m -> 900 mm (limit: none, was at most 2 m)"),
    ],
)
def test_a_change_in_words(before: dict[str, Any], after: dict[str, Any], told: str) -> None:
    assert comparison.change_words(check_change(before, after, 0)) == told
