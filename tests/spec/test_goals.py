"""A goal's score is linear between its two values, in either direction."""

import math

import pytest

from dodo_dsl.spec.model import Goal, is_goal


@pytest.mark.parametrize(
    ("value", "less", "more"),
    [(5.0, 1.0, 0.0), (20.0, 0.0, 1.0), (12.5, 0.5, 0.5), (2.0, 1.0, 0.0), (99.0, 0.0, 1.0), (None, 0.0, 0.0)],
)
def test_scores(value: float | None, less: float, more: float) -> None:
    assert (Goal("time", 20.0, 5.0).score(value), Goal("time", 5.0, 20.0).score(value)) == (less, more)


def test_what_makes_no_score_is_no_goal() -> None:
    assert is_goal(Goal("time", 20, 5, 0.5))
    for wrong in ((5, 5, 1), (math.nan, 5, 1), (0, math.inf, 1), (0, 1, 0), (0, 1, -1), ("0", 1, 1)):
        assert not is_goal(Goal("time", *wrong))  # type: ignore[arg-type]
