"""Repetitions of tests."""

from dataclasses import replace

from dodo_dsl.plan.plan_json import from_json, to_json
from dodo_dsl.plan.runs import Run, runs
from tests.plan.plans import BASE

OTHER = replace(BASE, name="find", slug="find")


def test_once() -> None:
    assert runs([BASE, OTHER], 1) == [Run(BASE, BASE.slug), Run(OTHER, "find")]


def test_round_by_round() -> None:
    found = runs([BASE, OTHER], 3)
    assert [run.plan.slug for run in found] == [
        "drive--light-dark",
        "find",
        "drive--light-dark--run-2",
        "find--run-2",
        "drive--light-dark--run-3",
        "find--run-3",
    ]
    assert [run.test for run in found] == ["drive--light-dark", "find"] * 3
    assert found[2].plan.name == "drive[light=dark][run=2]"
    assert replace(found[2].plan, name=BASE.name, slug=BASE.slug) == BASE
    assert from_json(to_json(found[4].plan)) == found[4].plan
