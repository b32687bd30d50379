"""What dodo.yml says of an application counts as if its compose file said it."""

from pathlib import Path

import pytest

from dodo_dsl.compiler import load
from dodo_dsl.compiler import plan as planned
from dodo_dsl.plan.model import ApplicationService
from dodo_dsl.spec.validation import schema_of_keys
from tests.application.compiled import FILE, repository

COMPOSE = """\
services:
  driver:
    image: driver
    command: --cid=111
    depends_on: {viewer: {condition: service_started, required: false}}
    x-dodo: {out: [opendlv.proxy.GroundSteeringRequest], readers: 2}
  viewer: {image: team/view, volumes: [/var/run/docker.sock:/var/run/docker.sock]}
"""
DEPLOYMENT = """\
dodo: 1
registry: [tests]
application:
  files: docker-compose.yml
  without: [viewer]
  services:
    driver:
      out: [opendlv.proxy.PedalPositionRequest, opendlv.proxy.GroundSteeringRequest]
      process: [python3, -m, steering]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository that has both files and the program."""
    root = repository(tmp_path, {FILE: COMPOSE, "steering.py": ""})
    (root / "dodo.yml").write_text(DEPLOYMENT)
    monkeypatch.chdir(root)
    return root


def services(root: Path) -> dict[str, ApplicationService]:
    checked = load([root / "tests" / "network.dodo.yml"])
    assert checked.ok, checked.diagnostics
    (plan,) = planned(checked, root / "generated").compiled.suite.plans
    return {service.name: service for service in plan.application.services}


def test_each_key_of_the_deployment_replaces_that_of_the_compose_file(folder: Path) -> None:
    found = services(folder)
    assert list(found) == ["driver"]
    assert found["driver"].outputs == ("opendlv.proxy.PedalPositionRequest", "opendlv.proxy.GroundSteeringRequest")
    assert found["driver"].process == ("python3", "-m", "steering")


def test_a_service_has_the_keys_of_x_dodo() -> None:
    declared = schema_of_keys("deployment")["properties"]["application"]["properties"]["services"]
    services = schema_of_keys("application")["properties"]["services"]
    keys = services["additionalProperties"]["properties"]["x-dodo"]["properties"]
    assert set(declared["additionalProperties"]["properties"]) == {*keys, "process"}
