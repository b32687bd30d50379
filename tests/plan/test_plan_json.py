"""Plans as JSON: they come back as they were, and nothing else is read."""

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings

from dodo_dsl.plan.model import Lockstep, Plan
from dodo_dsl.plan.plan_json import PlanError, from_json, to_json
from dodo_dsl.spec.settings import Settings
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
    ("name", 3, "string"),
    ("spec", "a\0b", "string"),
    ("more_tags", [3], "string"),
    ("pool", {"name": "drive", "slug": "../drive"}, "pool"),
    ("level", "mil", "level"),
    ("isolation", "none", "isolation"),
    ("timeout_s", 0, "timeout_s"),
    ("timeout_s", "60", "timeout_s"),
    ("cid", 255, "cid"),
    ("seed", 1 << 32, "seed"),
    ("lockstep", {"readers": 0, "wall_timeout_s": 1}, "lockstep"),
    ("resources", {"max_memory_mb": "200"}, "resources"),
    ("resources", {"max_processor_share": -0.1}, "resources"),
    ("messages", ["../x.odvd"], "messages"),
    ("messages", ["/x.odvd"], "messages"),
    ("import_paths", ["a\0b"], "import path"),
    ("shared", {"a.rec": "../a.rec"}, "shared file"),
    ("shared", {"../a.rec": f"{'0' * 64}-a.rec"}, "shared file"),
    ("goals", [{"check": "time", "zero": 1, "one": 1, "weight": 1}], "goal"),
    ("goals", [{"check": 3, "zero": 1, "one": 2, "weight": 1}], "goal"),
]
WRONG_SERVICES: list[tuple[str, Any, str]] = [
    ("name", "../x", "service name"),
    ("layer", "logic", "service layer"),
    ("flags", [{"name": "map", "value": "../x", "kind": "path"}], "flag"),
    ("flags", [{"name": "map", "value": "x", "kind": "other"}], "flag"),
    ("setup_s", -1, "set-up time"),
    ("devices", ["/etc/passwd"], "device"),
    ("process", [1], "command"),
]
WRONG_APPLICATIONS: list[tuple[str, Any, str]] = [
    ("command", [1], "command"),
    ("environment", [], "environment"),
    ("env_files", [1], "environment file"),
]


def document() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(to_json(BASE))
    return found


def refused(document: object) -> str:
    with pytest.raises(PlanError) as error:
        from_json(document if isinstance(document, str) else json.dumps(document))
    return str(error.value)


@pytest.mark.parametrize(("key", "value", "problem"), WRONG)
def test_wrong_values(key: str, value: Any, problem: str) -> None:
    assert refused({**document(), key: value}) == f"not a compiled test (wrong {problem}); compile it again"


@pytest.mark.parametrize(("key", "value", "problem"), WRONG_SERVICES)
def test_wrong_values_of_services(key: str, value: Any, problem: str) -> None:
    found = document()
    found["services"][0][key] = value
    assert f"(wrong {problem})" in refused(found)


@pytest.mark.parametrize(("key", "value", "problem"), WRONG_APPLICATIONS)
def test_wrong_values_of_the_application(key: str, value: Any, problem: str) -> None:
    found = document()
    found["application"]["services"][0][key] = value
    assert f"(wrong {problem})" in refused(found)


@pytest.mark.parametrize("after", [("b", "a"), ("c", "a", "b")])
def test_services_that_wait_for_one_another(after: tuple[str, ...]) -> None:
    """The first for the first of these, the second for the second, and so on; one that waits for itself, too."""
    found = document()
    (service,) = found["application"]["services"]
    found["application"]["services"] = [
        {**service, "name": name, "after": {other: "service_started"}}
        for name, other in zip("abc", after, strict=False)
    ]
    assert "(wrong order of starts: services wait for one another)" in refused(found)
    found["application"]["services"] = [{**service, "after": {service["name"]: "service_completed_successfully"}}]
    assert "(wrong order of starts: services wait for one another)" in refused(found)


@pytest.mark.parametrize("text", ["", "[]", "{}", "null", "[" * 100_000, '{"dodo": "plan", "version": 1}'])
def test_other_files(text: str) -> None:
    assert refused(text).startswith("not a compiled test (")


def test_another_version() -> None:
    assert refused({**document(), "version": 0}) == "not a compiled test (not a plan of version 1); compile it again"


@pytest.mark.parametrize("key", sorted(document().keys() - {"rig"}))
def test_a_missing_or_an_unknown_key(key: str) -> None:
    found = document()
    del found[key]
    refused(found)
    refused({**document(), f"{key}x": 1})
