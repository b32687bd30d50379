"""What dodo.yml says of an application counts as if its compose file said it."""

from pathlib import Path

import pytest

from dodo_dsl.application.model import ApplicationSource, plain
from dodo_dsl.compiler import load
from dodo_dsl.spec.validation import schema_of

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
application:
  files: docker-compose.yml
  without: [viewer]
  services:
    driver:
      out: [opendlv.proxy.PedalPositionRequest]
      process: [python3, -m, steering]
"""


def application(folder: Path, *given: Path) -> ApplicationSource:
    (folder / "docker-compose.yml").write_text(COMPOSE)
    (folder / "dodo.yml").write_text(DEPLOYMENT)
    found = load([], given).application
    assert found is not None
    return found


def test_each_key_of_the_deployment_replaces_that_of_the_compose_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = application(tmp_path, Path("docker-compose.yml"))
    declared = found.services["driver"].declared
    assert declared is not None
    assert [(name, Path(span.file).name, span.line) for name, span in declared.outputs] == [
        ("opendlv.proxy.PedalPositionRequest", "dodo.yml", 7)
    ]
    assert declared.readers == 2
    assert plain(found.services["driver"].node)["x-dodo-process"] == ["python3", "-m", "steering"]
    assert list(found.services) == ["driver"]
    assert found.dropped == {"viewer": "dodo.yml leaves it out"}


def test_something_has_to_be_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docker-compose.yml").write_text("services: {viewer: {image: view}}\n")
    (tmp_path / "dodo.yml").write_text("dodo: 1\napplication: {files: [docker-compose.yml], without: [viewer]}\n")
    [found] = load([], []).diagnostics
    assert (found.rule, found.message) == (
        "application-file",
        "'without' leaves out every service of the application, so that a test has nothing to start",
    )
    assert (Path(found.span.file).name, found.span.line, found.hint) == (
        "dodo.yml",
        2,
        "name a compose file that has the service of your program under 'files'",
    )


def test_they_are_about_the_files_that_they_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.yml").write_text("services: {steer: {image: steer, command: --cid=111}}")
    found = application(tmp_path, Path("other.yml"))
    assert (list(found.services), found.services["steer"].declared, found.dropped) == (["steer"], None, {})


def test_a_service_has_the_keys_of_x_dodo() -> None:
    declared = schema_of("deployment")["properties"]["application"]["properties"]["services"]
    keys = schema_of("application")["$defs"]["service"]["properties"]["x-dodo"]["properties"]
    assert set(declared["additionalProperties"]["properties"]) == {*keys, "process"}


def test_a_service_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docker-compose.yml").write_text(COMPOSE)
    (tmp_path / "dodo.yml").write_text("application: {files: docker-compose.yml, without: [viewer, driver]}\ndodo: 1\n")
    (problem,) = load([]).problems.common
    assert problem.message.startswith("'without' leaves out every service of the application")
