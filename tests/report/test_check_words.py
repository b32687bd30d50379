"""What checks say: what failed, and what a drive that ended early left undone."""

from typing import Any

import pytest

from dodo_dsl.report.comparison import check_line, only_follows


def check(name: str, value: float | None, ok: bool, unit: str = "m", **limit: float) -> dict[str, Any]:
    return {"name": name, "value": value, "limit": limit, "unit": unit, "ok": ok}


CLEAR = {**check("wall-margin", 0.17, True, min=0.0), "exclusive": True}


HIT = check("wall-margin", 0.0, False, min=0.0)
FAR = check("to-goal", 1.8, False, max=0.0)
LATE = check("time-to-goal", None, False, "s", max=40.0)


@pytest.mark.parametrize(
    ("shown", "others", "text"),
    [
        (HIT, [LATE, FAR], "FAIL wall-margin: 0 m (more than 0 m)"),
        (CLEAR, [], "ok   wall-margin: 0.17 m (more than 0 m)"),
        (check("steps", 3.0, True, "", max=4.0, min=2.0), [], "ok   steps: 3 (at least 2, at most 4)"),
        (check("wall-margin", 0.05, True, min=0.05), [], "ok   wall-margin: 0.05 m (at least 0.05 m)"),
        (check("error", 0.3, False, max=0.3), [], "FAIL error: 0.3 m (less than 0.3 m)"),
        (check("error", 0.4, False, max=0.3), [], "FAIL error: 0.4 m (at most 0.3 m)"),
        (FAR, [HIT], "--   to-goal: 1.8 m, when the drive ended"),
        (LATE, [HIT], "--   time-to-goal: none, when the drive ended"),
        (LATE, [FAR], "FAIL time-to-goal: none (at most 40 s)"),
        (LATE, [check("mean", 0.4, False, max=0.3)], "FAIL time-to-goal: none (at most 40 s)"),
        (check("distance", 2.0, True), [HIT], "ok   distance: 2 m"),
    ],
)
def test_a_check_in_a_line(shown: dict[str, Any], others: list[dict[str, Any]], text: str) -> None:
    assert check_line(shown, [shown, *others]) == text


def test_what_is_met_follows_from_nothing() -> None:
    assert not only_follows(check("gates", 3, True, "", min=3), [HIT])
