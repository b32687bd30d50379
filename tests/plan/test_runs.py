"""Repetitions of tests."""

from dataclasses import replace

from dodo_dsl.plan.model import Pooled, named, pooled, runs
from dodo_dsl.plan.plan_json import from_json, to_json
from tests.plan.plans import BASE

OTHER = replace(BASE, name="find", slug="find")


def test_repetitions_on_any_rig_are_of_one_test_each() -> None:
    on = [
        replace(BASE, name=f"drive[rig={rig}]", slug=f"drive--rig-{rig}", rig=rig, pool=Pooled("drive", "drive"))
        for rig in ("one", "two")
    ]
    found = runs(on, 2)
    assert [test for _, test in found] == ["drive--rig-one", "drive--rig-two"] * 2
    assert found[3][0].pool == Pooled("drive[run=2]", "drive--run-2")
    assert [named(plan).slug for plan, _ in found] == ["drive", "drive", "drive--run-2", "drive--run-2"]
    assert from_json(to_json(found[3][0])) == found[3][0]
    assert [[plan.rig for plan in group] for group in pooled([OTHER, *on])] == [[""], ["one", "two"]]


def test_round_by_round() -> None:
    found = runs([BASE, OTHER], 2)
    assert [plan.slug for plan, _ in found] == ["drive--light-dark", "find", "drive--light-dark--run-2", "find--run-2"]
    assert [test for _, test in found] == ["drive--light-dark", "find"] * 2
    assert found[2][0].name == "drive[light=dark][run=2]"
    assert replace(found[2][0], name=BASE.name, slug=BASE.slug) == BASE
