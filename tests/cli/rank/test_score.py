"""Scores and their order."""

from dataclasses import replace

import pytest

from dodo_dsl.cli.rank import rank, run_score
from dodo_dsl.outcome import Outcome, Result
from dodo_dsl.spec.model import Goal

BASE = Outcome("t", "t", "t.dodo.yml", "sil", "closed-loop", "passed", "so", 130, 0, "lockstep", "process")
GOALS = (Goal("time", 20.0, 10.0, 3.0), Goal("margin", 0.0, 0.25))


def run(time: float | None, margin: float = 0.25, outcome: Result = "passed", name: str = "t") -> Outcome:
    checks = tuple({"name": n, "value": v, "ok": True} for n, v in (("time", time), ("margin", margin)))
    return replace(BASE, name=name, outcome=outcome, checks=checks, goals=GOALS)


def order(**teams: list[Outcome]) -> list[tuple[int, str]]:
    return [(place, team.name) for place, team in rank(teams)]


def test_a_run_scores_the_weighted_mean_of_its_goals() -> None:
    assert run_score(run(15.0, 0.25)) == pytest.approx((3 * 0.5 + 1) / 4)
    assert run_score(run(None, 0.125)) == pytest.approx(0.5 / 4)
    assert run_score(run(10.0, outcome="failed")) == 0.0
    assert run_score(BASE) == 1.0
    twice = replace(run(15.0), checks=(*run(15.0).checks, {"name": "time", "value": 18.0, "ok": True}))
    assert run_score(twice) == pytest.approx((3 * 0.2 + 1) / 4)


def test_failures_are_below_everything() -> None:
    slow, quick, hit = run(20.0, 0.0), run(10.0), run(10.0, outcome="failed")
    assert order(quick=[quick], slow=[slow]) == [(1, "quick"), (2, "slow")]
    assert order(often=[hit, hit, quick], once=[quick, quick, hit], slow=[slow, slow]) == [
        (1, "slow"), (2, "once"), (3, "often"),
    ]  # fmt: skip
    assert order(b=[quick], a=[quick], c=[slow]) == [(1, "a"), (1, "b"), (3, "c")]


def test_a_test_without_an_answer_counts_as_failed() -> None:
    other, broken = run(20.0, name="other"), run(None, outcome="error", name="other")
    assert order(part=[run(10.0)], whole=[run(20.0), other]) == [(1, "whole"), (2, "part")]
    assert order(part=[run(10.0), broken], whole=[run(20.0), other]) == [(1, "whole"), (2, "part")]
    ((_, ranked),) = rank({"lucky": [broken, other]})
    assert (ranked.failure_rate, ranked.tests["other"].errors) == (0.0, 1)


def test_repeated_runs_are_of_one_test() -> None:
    ((_, ranked),) = rank({"a": [run(10.0, name="t[x=1]"), run(20.0, name="t[x=1][run=2]"), run(10.0, name="t[x=2]")]})
    assert {name: len(test.runs) for name, test in ranked.tests.items()} == {"t[x=1]": 2, "t[x=2]": 1}


def test_runs_at_samples_of_the_ranges_are_of_one_test() -> None:
    names = ("t[sample=1,light=0.7]", "t[sample=2,light=1.1][run=2]", "u[x=1,sample=1,of=[a]]", "u[x=1,sample=2,of=b]")
    ((_, ranked),) = rank({"a": [run(10.0, name=name) for name in names]})
    assert {name: len(test.runs) for name, test in ranked.tests.items()} == {"t": 2, "u[x=1]": 2}


def test_runs_of_joined_reports_are_of_one_test() -> None:
    names = ("t", "t[report=2]", "t[run=2][report=2]")
    ((_, ranked),) = rank({"a": [run(10.0, name=name) for name in names]})
    assert {name: len(test.runs) for name, test in ranked.tests.items()} == {"t": 3}
