"""Variables that a test sets for its application, in both backends."""

import json
from pathlib import Path

import pytest

from dodo_dsl.run.process.commands import Commands
from dodo_dsl.run.process.slot import Slot
from tests.application.compiled import FILE, Compiled, compiled, repository

COMPOSE = """\
services:
  mapped:
    image: ${IMAGE:-example}
    command: "--cid=111 --speed=${SPEED:-1} --rate=${RATE:-2} --faster=${FASTER:-${SPEED}}"
    environment: {SPEED: 3, TWICE: "${SPEED}${SPEED}", RATE: }
    env_file: [car.env]
    volumes: ["./data${SPEED:-0}:/data"]
    x-dodo-process: [./car]
  listed:
    image: example
    entrypoint: [car, "--mode=$MODE"]
    command: ["--cid=111", "$SPEED"]
    environment: [SPEED, OTHER=$MODE, RATE=4]
    x-dodo-process: [./car]
  without:
    image: example
    command: --cid=111
    x-dodo-process: [./car]
"""
GIVEN = {"SPEED": "0.5", "MODE": "a$b c"}


@pytest.fixture
def test_of_car(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Compiled:
    monkeypatch.setenv("SPEED", "of the machine")
    files = {FILE: COMPOSE, ".env": "SPEED=7\nRATE=8\n", "car.env": "SPEED=9\n", "data/x": ""}
    root = repository(tmp_path, files)
    (root / "car").touch(0o755)
    spec = root / "tests" / "network.dodo.yml"
    spec.write_text(f"{spec.read_text()}application: {{env: {json.dumps(GIVEN)}}}\n")
    return compiled(root)


@pytest.mark.thorough
def test_the_copy_has_them(test_of_car: Compiled) -> None:
    services = test_of_car.services
    assert services["mapped"]["command"] == ["--cid=140", "--speed=0.5", "--rate=8", "--faster=0.5"]
    assert services["mapped"]["environment"].items() >= {"TWICE": "0.50.5", "RATE": "8", **GIVEN}.items()
    assert services["listed"]["environment"].items() >= {"OTHER": "a$b c", "RATE": "4", **GIVEN}.items()
    assert services["listed"]["entrypoint"] == ["car", "--mode=a$b c"]
    assert services["without"]["environment"].items() >= GIVEN.items()


def test_they_reach_nothing_else(test_of_car: Compiled) -> None:
    """A test cannot choose images, mounts or files of the host with them."""
    assert "0.5" not in str([service.get("volumes") for service in test_of_car.services.values()])


def test_processes_have_them(test_of_car: Compiled, tmp_path: Path) -> None:
    assert test_of_car.plan is not None
    one = Commands(test_of_car.plan, test_of_car.folder, tmp_path / "report", Slot(150))
    made = {service.name: one.of(service) for service in test_of_car.plan.application.services}
    assert made["mapped"].argv == ("./car", "--cid=150", "--speed=0.5", "--rate=8", "--faster=0.5")
    assert made["listed"].argv == ("./car", "--cid=150", "0.5")
    for command in made.values():
        assert {name: command.environment[name] for name in GIVEN} == GIVEN
    assert made["mapped"].environment["TWICE"] == "0.50.5"
    assert made["listed"].environment["OTHER"] == "a$b c"
