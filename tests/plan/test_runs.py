"""Repetitions of tests."""

from dataclasses import replace

from dodo_dsl.plan.model import Pooled
from dodo_dsl.plan.plan_json import from_json, to_json
from dodo_dsl.plan.runs import Run, by_test, named, pooled, runs
from tests.plan.plans import BASE

OTHER = replace(BASE, name="find", slug="find")


def test_once() -> None:
    assert runs([BASE, OTHER], 1) == [Run(BASE, BASE.slug), Run(OTHER, "find")]


def test_repetitions_on_any_rig_are_of_one_test_each() -> None:
    on = [
        replace(BASE, name=f"drive[rig={rig}]", slug=f"drive--rig-{rig}", rig=rig, pool=Pooled("drive", "drive"))
        for rig in ("one", "two")
    ]
    found = runs(on, 2)
    assert [run.test for run in found] == ["drive--rig-one", "drive--rig-two"] * 2
    assert found[3].plan.pool == Pooled("drive[run=2]", "drive--run-2")
    assert [named(run.plan).slug for run in found] == ["drive", "drive", "drive--run-2", "drive--run-2"]
    assert from_json(to_json(found[3].plan)) == found[3].plan
    assert [[plan.rig for plan in group] for group in pooled([OTHER, *on])] == [[""], ["one", "two"]]
    assert [plan.name for plan in by_test([OTHER, *on])] == ["find", "drive"]


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
