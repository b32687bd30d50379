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


STEPPED = {"readers": 1, "wall_timeout_s": 1, "max_response_s": None, "response_over": 0, "is_copied": False}
LIMITS = dict.fromkeys(("max_memory_mb", "max_memory_growth", "max_processor_time_s", "max_processor_share"))
WRONG: list[tuple[str, Any, str]] = [
    ("slug", "../x", "slug"),
    ("spec", "a\0b", "string"),
    ("pool", {"name": "drive", "slug": "../drive"}, "slug"),
    ("level", "mil", "level"),
    ("isolation", "none", "isolation"),
    ("timeout_s", 0, "timeout_s"),
    ("cid", 255, "cid"),
    ("seed", 1 << 32, "seed"),
    ("lockstep", STEPPED | {"readers": 0}, "lockstep"),
    ("lockstep", STEPPED | {"response_over": 1.1}, "lockstep"),
    ("resources", LIMITS | {"max_processor_share": -0.1}, "resources"),
    ("messages", ["../x.odvd"], "messages"),
    ("messages", ["/x.odvd"], "messages"),
    ("import_paths", ["a\0b"], "import path"),
    ("shared", {"a.rec": "../a.rec"}, "shared file"),
    ("shared", {"../a.rec": f"{'0' * 64}-a.rec"}, "shared file"),
    ("goals", [{"check": "time", "zero": 1, "one": 1, "weight": 1}], "goal"),
]
WRONG_SERVICES: list[tuple[str, Any, str]] = [
    ("name", "../x", "service name"),
    ("layer", "logic", "service layer"),
    ("flags", [{"name": "map", "value": "../x", "kind": "path"}], "flag"),
    ("setup_s", -1, "set-up time"),
    ("devices", ["/etc/passwd"], "device"),
]
OTHER_TYPES: list[tuple[str, Any, str]] = [
    ("name", 3, "Expected `str`, got `int` - at `$.name`"),
    ("more_tags", [3], "Expected `str`, got `int` - at `$.more_tags[0]`"),
    ("timeout_s", "60", "Expected `float`, got `str` - at `$.timeout_s`"),
    ("seed", True, "Expected `int`, got `bool` - at `$.seed`"),
    (
        "resources",
        LIMITS | {"max_memory_mb": "2"},
        "Expected `float | null`, got `str` - at `$.resources.max_memory_mb`",
    ),
    ("goals", [{"check": 3, "zero": 1, "one": 2, "weight": 1}], "Expected `str`, got `int` - at `$.goals[0].check`"),
    (
        "services.0.flags",
        [{"name": "map", "value": "x", "kind": "other"}],
        "Invalid enum value 'other' - at `$.services",
    ),
    ("services.0.process", [1], "Expected `str`, got `int` - at `$.services[0].process[0]`"),
    ("application.services.0.command", [1], "Expected `str`, got `int` - at `$.application.services[0].command[0]`"),
    ("application.services.0.environment", [], "Expected `object`, got `array`"),
    ("application.services.0.env_files", [1], "Expected `str`, got `int`"),
    ("application.access.outside", 1, "Expected `bool`, got `int` - at `$.application.access.outside`"),
]
OTHER_KEYS: list[tuple[str, Any]] = [
    ("services.0.flags", [{"name": "map", "value": "x", "kind": "text", "more": 1}]),
    ("services.0.flags", [{"name": "map", "value": "x"}]),
    ("application.access", {}),
    ("timeout_s", float("nan")),
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


@pytest.mark.parametrize("line", [{"match": "(", "sender": 0}, {"match": "(?P<percent>.)", "sender": -1}])
def test_wrong_lines_of_the_application(line: dict[str, Any]) -> None:
    found = document()
    found["application"]["services"][0]["lines"] = [{**line, "message": "opendlv.proxy.PedalPositionRequest"}]
    assert "(wrong line)" in refused(found)


def with_value(place: str, value: Any) -> dict[str, Any]:
    found = document()
    *steps, key = place.split(".")
    inner: Any = found
    for step in steps:
        inner = inner[int(step) if step.isdigit() else step]
    inner[key] = value
    return found


@pytest.mark.parametrize(("place", "value", "problem"), OTHER_TYPES)
def test_values_of_another_type(place: str, value: Any, problem: str) -> None:
    assert refused(with_value(place, value)).startswith(f"not a compiled test ({problem}")


@pytest.mark.parametrize(("place", "value"), OTHER_KEYS)
def test_missing_and_unknown_keys_at_any_depth(place: str, value: Any) -> None:
    assert "(its keys are not those of this version)" in refused(with_value(place, value))


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


@pytest.mark.parametrize("key", sorted(document()))
def test_a_missing_or_an_unknown_key(key: str) -> None:
    found = document()
    del found[key]
    refused(found)
    refused({**document(), f"{key}x": 1})


def test_lines_are_written_where_there_are_some() -> None:
    """So that plans without them are as before."""
    service = ApplicationService("app", lines=(Line("(?P<x>.)", "a.B", 2),))
    plan = replace(BASE, application=replace(BASE.application, services=(service,)))
    assert from_json(to_json(plan)) == plan
    assert '"lines"' not in to_json(BASE)
    wrong = to_json(plan).replace('"sender": 2', '"sender": -1')
    with pytest.raises(PlanError, match="wrong line"):
        from_json(wrong)
