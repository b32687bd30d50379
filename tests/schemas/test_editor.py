"""What editors are told of services: made from the manifests, complete, and never in the way."""

import json
import runpy
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator

from dodo_dsl import package_data
from dodo_dsl.spec.manifest import load_manifests

MANIFESTS, _ = load_manifests()
FILE = package_data.schemas() / "dodo.schema.json"
SPECS = sorted(package_data.registry().glob("*/*.dodo.yml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    made: dict[str, Any] = json.loads(FILE.read_text())
    return made


def problems(schema: dict[str, Any], use: object) -> list[str]:
    """What an editor says of a service as written in a spec."""
    validator = Draft202012Validator({"$ref": "#/$defs/use", "$defs": schema["$defs"]})
    return [error.message for error in validator.iter_errors(use)]


def test_the_schema_is_what_the_manifests_say() -> None:
    script = runpy.run_path(str(package_data.root() / "scripts" / "editor_schema.py"))
    assert script["generate"](FILE.read_text(), MANIFESTS) == FILE.read_text(), "run `make schema`"


def test_each_service_is_offered_with_its_sentence_and_all_its_parameters(schema: dict[str, Any]) -> None:
    offered = {
        o["const"]: o["description"] for o in schema["$defs"]["use"]["allOf"][0]["properties"]["uses"]["anyOf"][:-1]
    }
    assert set(offered) == set(MANIFESTS) - {"clock"}
    for name, description in offered.items():
        assert description.startswith(MANIFESTS[name].description)
        assert schema["$defs"][f"with-{name}"]["properties"].keys() == MANIFESTS[name].parameters.keys()


@pytest.mark.parametrize("path", SPECS, ids=lambda p: p.parent.name)
def test_the_registry_is_fine_in_an_editor(path: Path, schema: dict[str, Any]) -> None:
    spec = yaml.safe_load(path.read_text())
    if "extends" in spec:  # the rest is in the file that it extends
        schema = {**schema, "required": ["dodo", "name"]}
    errors = Draft202012Validator(schema).iter_errors(spec)
    assert [(list(e.absolute_path), e.message) for e in errors] == []


@pytest.mark.parametrize(
    "use",
    [
        {"uses": "my-judge", "with": {"anything": 1, "list": ["a"]}},
        {"uses": "my-judge"},
        {"uses": "collision", "with": {"max-time": "${matrix.time}", "walls": "left"}},
        {"uses": "integrator", "with": {"freq": "0.1 kHz", "yaw": "1.5 rad", "frame-id": "${matrix.id}"}},
        {"uses": "object-detection", "with": {"iou": 0.5, "min-f1": "80 %", "min-recall": 1}},
        {"uses": "rec-replay", "with": {"rec": "a.rec", "autorewind": True, "message-set": "0.9"}},
    ],
)
def test_what_may_be_written(use: object, schema: dict[str, Any]) -> None:
    assert problems(schema, use) == []


@pytest.mark.parametrize(
    ("use", "said"),
    [
        ({"uses": "integrator", "with": {"frq": "10 Hz"}}, "'frq' was unexpected"),
        ({"uses": "integrator", "with": {"freq": 10}}, "10 is not of type 'string'"),
        ({"uses": "integrator", "with": {"freq": "10"}}, "'10' does not match"),
        ({"uses": "virtual-camera", "with": {"freq": "10 Hz"}}, "'map-path' is a required property"),
        (
            {"uses": "continuous-signal", "with": {"message": "a.b", "field": "c", "target": "d", "align": "x"}},
            "'x' is not",
        ),
        ({"uses": "object-detection", "with": {"iou": 2}}, "2 is not valid"),
    ],
)
def test_what_an_editor_underlines(use: object, said: str, schema: dict[str, Any]) -> None:
    (problem,) = problems(schema, use)
    assert said in problem


def test_a_test_that_extends_another_one_may_leave_out_what_a_service_uses(schema: dict[str, Any]) -> None:
    own = {"dodo": 1, "name": "t", "evaluation": {"track": {"with": {"max-time": "9 s"}}}}
    validator = Draft202012Validator(schema)
    assert [error.message for error in validator.iter_errors({**own, "extends": "../a.dodo.yml"})] == []
    assert "'uses' is a required property" in [error.message for error in validator.iter_errors(own)]


@pytest.mark.parametrize(
    ("values", "fits"),
    [
        ({"id": [0, 2], "yaw": ["0 deg", "180 deg"]}, True),
        ({"id": 0, "yaw": "0.5 rad"}, True),
        ({"id": [0, "two"]}, False),
        ({"id": [0], "yaw": [90]}, False),
    ],
)
def test_items_of_lists_have_their_types(values: dict[str, Any], fits: bool, schema: dict[str, Any]) -> None:
    use = {"uses": "range-finder", "with": {"map-path": "../maps/straight", **values}}
    assert (problems(schema, use) == []) == fits
