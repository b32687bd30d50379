"""What changed between two reports: on the terminal, and by which direction."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.outcome import Outcome
from dodo_dsl.report import comparison
from dodo_dsl.report.comparison import Comparison, compare, direction
from dodo_dsl.report.results import GivenReport
from tests.report.joined.reports import check, named

CASES = [
    (check(1, max=2), check(1.5, max=2), "worse"),
    (check(1, min=0.5), check(1.5, min=0.5), "better"),
    (check(0.4, min=0.5), check(0.6, min=0.5), "better"),
    (check(0.1, min=0.5), check(0.4, min=0.5), "better"),
    (check(0.9, min=-1, max=1), check(-0.9, min=-1, max=1), "different"),
    (check(6.55, max=40), check(6.54, max=40), "unchanged"),
    (check(6.55, max=40), check(6.4, max=40), "better"),
    (check(6.55, max=6.6), check(6.61, max=6.6), "worse"),
    (check(480, min=450), check(479, min=450), "worse"),
    (check(1), check(2), "different"),
    (check(None, ok=True, max=2), check(1, max=2), "different"),
    (check(1, max=2), check(None, ok=False, max=2), "worse"),
    (check(None, ok=False, max=2), check(None, ok=False, max=2), "unchanged"),
    (check(1, max=2), check(1, max=3), "better"),
    (check(1, max=2), check(1000, unit="mm", max=2000), "different"),
    (check(1, max=5, name="slow-answers"), check(4, max=5, name="slow-answers"), "unchanged"),
    (check(1, max=5, name="slow-answers"), check(6, max=5, name="slow-answers"), "worse"),
]


@pytest.mark.parametrize(("before", "after", "expected"), CASES)
def test_direction(before: dict[str, Any], after: dict[str, Any], expected: str) -> None:
    assert direction(before, after) == expected


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.sampled_from(["min", "max"]))
def test_turned_round_a_change_has_the_other_direction(was: float, now: float, bound: float, side: str) -> None:
    before, after = check(was, **{side: bound}), check(now, **{side: bound})
    there, back = direction(before, after), direction(after, before)
    assert back == {"better": "worse", "worse": "better"}.get(there, there)
    if there == "better":
        assert now > was if side == "min" else now < was


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (check(0.12, min=0.03), check(0.05, min=0.03), "0.12 m -> 0.05 m (limit: at least 0.03 m)"),
        (check(1, unit=""), check(3, unit=""), "1 -> 3"),
        (check(1, max=2), check(None, ok=False, max=3), "1 m -> none (limit: at most 3 m, was at most 2 m)"),
        (check(1, max=2), check(900, unit="mm"), "1 m -> 900 mm (limit: none, was at most 2 m)"),
    ],
)
def test_a_change_in_words(before: dict[str, Any], after: dict[str, Any], told: str) -> None:
    assert comparison._values(before, after) == told


def compared(before: list[Outcome], after: list[Outcome]) -> Comparison:
    return compare(after, GivenReport(Path("main/results.json"), before))


def failed(name: str, *checks: dict[str, object]) -> Outcome:
    return named(name, outcome="failed", reason="hit wall", checks=checks)


BEFORE = [named("a"), failed("b"), failed("c"), named("d", checks=(check(1, max=2), check(3, max=4))), named("old")]
AFTER = [
    failed("a", check(1, max=2)),
    named("b"),
    named("c", outcome="error", reason="crashed"),
    named("d", checks=(check(1.5, max=2), check(3, max=4), {**check(5), "name": "y"})),
    named("new"),
]


def test_the_terminal_shows_what_changed() -> None:
    """Each test is of one kind, and checks of one name are compared in their order."""
    assert list(comparison.change_lines(compared(BEFORE, AFTER))) == [
        "compared with main/results.json: 1 newly failing, 1 still failing, 1 new, 1 gone, 1 fixed, 1 still passing",
        "  NEWLY FAILING  a  passed -> failed, hit wall",
        "  STILL FAILING  c  failed -> error, crashed",
        "  NEW            new  passed, drove",
        "  GONE           old  passed, drove",
        "  FIXED          b  failed -> passed, drove",
        "  worse          d  x: 1 m -> 1.5 m (limit: at most 2 m)",
        "  1 check unchanged",
    ]
