"""Checks in words and as bars, and which of them is shown first."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.outcome import with_margin
from dodo_dsl.report.checks import (
    MEANINGS,
    bar_place,
    check_line,
    decisive,
    meaning,
    measured,
    number,
    only_follows,
    title,
)
from tests.report.joined.reports import PASSED, check, named

CLEAR = {**check(0.17, True, name="wall-margin", min=0.0), "exclusive": True}
HIT = check(0.0, False, name="wall-margin", min=0.0)
FAR = check(1.8, False, name="to-goal", max=0.0)
LATE = check(None, False, "s", "time-to-goal", max=40.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0295876, "0.0296"), (0.00659, "0.00659"), (25, "25"), (1280.0, "1280"), (1280.4, "1280"), (-1.005, "-1"),
     (1e-9, "1e-09"), (123456.7, "123457"), (0.1002, "0.1"), (3e12, "3e+12"), (float("inf"), "inf")],
)  # fmt: skip
def test_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_a_value_beside_its_limit_has_as_many_digits_as_it_needs() -> None:
    assert measured(check(0.02999, min=0.03)) == "0.02999 m"
    assert measured(check(0.029, min=0.03)) == "0.029 m"


@pytest.mark.parametrize(
    ("shown", "others", "text"),
    [
        (HIT, [LATE, FAR], "FAIL wall-margin: 0 m (more than 0 m)"),
        (CLEAR, [], "ok   wall-margin: 0.17 m (more than 0 m)"),
        (check(3.0, unit="", max=4.0, min=2.0), [], "ok   x: 3 (at least 2, at most 4)"),
        (check(0.3, False, max=0.3), [], "FAIL x: 0.3 m (less than 0.3 m)"),
        (FAR, [HIT], "--   to-goal: 1.8 m, when the drive ended"),
        (LATE, [FAR], "FAIL time-to-goal: none (at most 40 s)"),
        (check(2.0), [HIT], "ok   x: 2 m"),
    ],
)
def test_a_check_in_a_line(shown: dict[str, Any], others: list[dict[str, Any]], text: str) -> None:
    assert check_line(shown, [shown, *others]) == text
    assert not only_follows(check(3, min=3, name="gates"), [HIT])


@pytest.mark.parametrize(
    ("checks", "headline", "shown"),
    [
        ([], "", None),
        ([check(1)], "", None),
        ([check(9, max=10, name="a"), check(0.1, min=0.01, name="b"), check(5, max=6, unit="s", name="c")], "", "a"),
        ([check(9, max=10, name="a"), check(0.1, min=0.01, name="b")], "b", "b"),
        ([check(9, max=10, name="a"), check(2, max=1, name="b"), check(3, max=1, name="c")], "a", "b"),
        ([LATE, HIT], "", "wall-margin"),
        ([check(1, unit="", min=0.9, name="coverage"), check(8, max=10, name="b")], "", "b"),
        ([check(0, max=0.1, name="mean"), check(1, max=10, name="b")], "", "b"),
    ],
)
def test_the_check_to_show(checks: list[dict[str, Any]], headline: str, shown: str | None) -> None:
    """What cannot be better is not nearest to failing."""
    found = decisive(replace(PASSED, checks=tuple(map(with_margin, checks)), headline=headline))
    assert (found and found["name"]) == shown


def test_a_title_is_the_first_reason() -> None:
    assert title(named("a", outcome="failed", reason="hit wall; late: 3 s; silent")) == "hit wall (+2 more)"
    failed = (check(0.07095, unit="", max=0.014, name="mean"), check(0.2, unit="", max=0.1, name="std"))
    outcome = named("a", outcome="failed", reason="the mean is 0.07095 (at most 0.014); so on", checks=failed)
    assert title(outcome) == "mean 0.0709 (at most 0.014) (+1 more)"
    assert title(named("a", reason="kept to its target: mean 0.1; share 1")) == "kept to its target"


def test_every_check_of_a_shipped_evaluator_is_explained_and_no_other() -> None:
    services = Path(__file__).parents[2] / "services"
    names = {
        name for file in services.glob("*/service.yml") for name in yaml.safe_load(file.read_text()).get("checks", ())
    }
    assert [name for name in names if not meaning({"name": name.replace("*", "blue")})] == []
    assert meaning({"name": "distance"}, ["distance", "max-speed"]) == "distance that the vehicle drove"
    assert meaning({"name": "distance"}, ["mean", "distance"]) == "largest distance of a sample from the target"
    of_the_test = {"slow-answers", "uncopied-sample-times"}
    assert {*MEANINGS} - names - of_the_test == {"peak-memory", "processor-time", "processor-share"}


@pytest.mark.parametrize(
    ("checked", "expected"),
    [
        (check(2.0, ok=False, max=1), (0, 50, 50, 25, False)),
        (check(3.0, min=1), (50, 100, 50, 33, True)),
        (check(2.0, min=1, max=3), (25, 75, 25, 25, True)),
        (check(9.0, min=1, max=3, ok=False), (25, 75, 75, 21, False)),
        (HIT, (50, 100, 50, 2, False)),
        (LATE, None),
        (check(2.0), None),
    ],
)
def test_a_bar_leads_from_the_limit_to_the_value(checked: dict[str, Any], expected: object) -> None:
    assert bar_place(checked) == expected
