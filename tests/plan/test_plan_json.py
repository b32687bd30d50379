"""Plans as JSON: they come back as they were, and nothing else is read."""

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings

from dodo_dsl.plan.model import ApplicationService, Line, Lockstep, Plan
from dodo_dsl.plan.plan_json import PlanError, from_json, to_json
from dodo_dsl.spec.load import Settings
from tests.plan.plans import BASE, plans


@settings(max_examples=30, deadline=None)
@given(plans)
@pytest.mark.thorough
def test_a_plan_survives_its_file(plan: Plan) -> None:
    assert from_json(to_json(plan)) == plan


def test_settings_replace_seed_and_wall_timeout() -> None:
    stepped = replace(BASE, clock="lockstep", lockstep=Lockstep(1, 600.0))
    found = from_json(to_json(stepped), Settings(seed=7, wall_timeout_s=9.0))
    assert (found.seed, found.lockstep) == (7, Lockstep(1, 9.0))
    assert from_json(to_json(BASE), Settings(wall_timeout_s=9.0)).lockstep is None


WRONG: list[tuple[str, Any, str]] = [
    ("slug", "../x", "slug"),
    ("pool", {"name": "drive", "slug": "../drive"}, "slug"),
    ("level", "mil", "level"),
    ("isolation", "none", "isolation"),
    ("timeout_s", 0, "timeout_s"),
    ("cid", 255, "cid"),
    ("seed", 1 << 32, "seed"),
    ("messages", ["../x.odvd"], "path"),
    ("messages", ["/x.odvd"], "path"),
    ("shared", {"a.rec": "../a.rec"}, "shared file"),
    ("shared", {"../a.rec": f"{'0' * 64}-a.rec"}, "path"),
    ("services.0.name", "../x", "service name"),
    ("services.0.layer", "logic", "service layer"),
    ("services.0.flags", [{"name": "map", "value": "../x", "kind": "path"}], "path"),
]
OTHER_TYPES: list[tuple[str, Any]] = [
    ("more_tags", [3]),
    ("timeout_s", "60"),
    ("seed", True),
    ("services.0.flags", [{"name": "map", "value": "x", "kind": "other"}]),
    ("application.services.0.environment", []),
    ("application.access.outside", 1),
]
OTHER_KEYS: list[tuple[str, Any]] = [
    ("services.0.flags", [{"name": "map", "value": "x", "kind": "text", "more": 1}]),
    ("timeout_s", float("nan")),
]


def document() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(to_json(BASE))
    return found


def refused(document: object) -> str:
    with pytest.raises(PlanError) as error:
        from_json(document if isinstance(document, str) else json.dumps(document))
    return str(error.value)


def with_value(place: str, value: Any) -> dict[str, Any]:
    found = document()
    *steps, key = place.split(".")
    inner: Any = found
    for step in steps:
        inner = inner[int(step) if step.isdigit() else step]
    inner[key] = value
    return found


@pytest.mark.parametrize(("place", "value", "problem"), WRONG)
def test_wrong_values(place: str, value: Any, problem: str) -> None:
    assert f"(wrong {problem})" in refused(with_value(place, value))


@pytest.mark.parametrize(("place", "value"), OTHER_TYPES)
def test_values_of_another_type_are_named(place: str, value: Any) -> None:
    assert f" - at `$.{place.replace('.0', '[0]').partition('.flags')[0]}" in refused(with_value(place, value))


@pytest.mark.parametrize(("place", "value"), OTHER_KEYS)
def test_unknown_keys_at_any_depth(place: str, value: Any) -> None:
    assert "(its keys are not those of this version)" in refused(with_value(place, value))


@pytest.mark.parametrize("text", ["", "[]", "{}", "null", "[" * 100_000, '{"dodo": "plan", "version": 1}'])
def test_other_files(text: str) -> None:
    assert refused(text).startswith("not a compiled test (")


def test_another_version() -> None:
    assert refused({**document(), "version": 0}) == "not a compiled test (not a plan of version 1); compile it again"


@pytest.mark.parametrize("key", sorted(document()))
def test_a_missing_or_an_unknown_key(key: str) -> None:
    found = document()
    del found[key]
    refused(found)
    refused({**document(), f"{key}x": 1})


def test_what_is_printed_is_read_again() -> None:
    service = ApplicationService("app", lines=(Line("(?P<x>.)", "a.B", 2),))
    plan = replace(BASE, application=replace(BASE.application, services=(service,)))
    assert from_json(to_json(plan)) == plan
