import json
import math

import numpy as np
import pytest

from services.base.service import Check, Verdict, period_of


@pytest.mark.parametrize(("slow", "fast"), [(30.0, 60.0), (15.0, 60.0), (12.0, 24.0), (29.97, 59.94), (0.3, 0.9)])
def test_multiples_of_a_rate_stay_aligned(slow: float, fast: float) -> None:
    one, other = period_of(slow), period_of(fast)
    times = round(fast / slow)
    assert all(round(n * one) == round(n * times * other) for n in range(0, 100_000, 7))


def test_the_line() -> None:
    verdict = Verdict(
        "passed",
        "reached finish after 3.20 s",
        (Check("time-to-goal", 3.2, {"max": 40}, "s", True), Check("count", 3, {"min": 1, "max": 5})),
    )
    assert verdict.line() == (
        '{"dodo": "verdict", "outcome": "passed", "reason": "reached finish after 3.20 s", "checks": ['
        '{"name": "time-to-goal", "value": 3.2, "limit": {"max": 40}, "unit": "s", "ok": true}, '
        '{"name": "count", "value": 3, "limit": {"min": 1, "max": 5}, "unit": "", "ok": true}]}'
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, None, np.float32("nan")])
def test_no_finite_value_is_null(value: float) -> None:
    (check,) = json.loads(Verdict("failed", "", (Check("x", value, {"min": math.inf, "max": 1}, ok=False),)).line())[
        "checks"
    ]
    assert check == {"name": "x", "value": None, "limit": {"max": 1}, "unit": "", "ok": False}


def test_evidence_is_in_the_line_where_there_is_some() -> None:
    evidence = {"time": np.float64(0.5), "sample-time": 1_700_000_000_100_000, "obstacle": "left", "x": math.nan}
    assert json.loads(Verdict("failed", "hit", evidence=evidence).line())["evidence"] == {
        "time": 0.5, "sample-time": 1_700_000_000_100_000, "obstacle": "left", "x": None,
    }  # fmt: skip
    assert json.loads(Verdict("failed", "hit", silent=True).line())["silent"] is True
    assert not {"evidence", "silent"} & json.loads(Verdict("failed", "hit").line()).keys()
