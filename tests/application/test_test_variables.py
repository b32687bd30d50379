"""Variables that a test sets for its application, in both backends."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.application.interpolation import interpolate, with_values
from dodo_dsl.application.read import read_application
from dodo_dsl.application.variables import owner
from dodo_dsl.plan.model import Application, Plan
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting
from dodo_dsl.run.process.commands import Command, Commands
from dodo_dsl.run.process.slot import Slot
from tests.application.composed import config

COMPOSE = """\
services:
  mapped:
    image: ${IMAGE:-example}
    command: "--cid=111 --speed=${SPEED:-1} --rate=${RATE:-2} --faster=${FASTER:-${SPEED}}"
    environment: {SPEED: 3, TWICE: "${SPEED}${SPEED}", RATE: }
    env_file: [car.env]
    volumes: ["${SPEED:-./data}:/data"]
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
def application(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Application:
    monkeypatch.setenv("SPEED", "of the machine")
    (tmp_path / "compose.yml").write_text(COMPOSE)
    (tmp_path / ".env").write_text("SPEED=7\nRATE=8\n")
    (tmp_path / "car.env").write_text("SPEED=9\n")
    source, problems = read_application(tmp_path / "compose.yml")
    assert source is not None, problems
    return plan_application(source, Setting(140, "host", tmp_path / "generated" / "t", given=tuple(GIVEN.items())))


@pytest.mark.thorough
def test_the_copy_has_them(application: Application) -> None:
    services = application.compose["services"]
    assert services["mapped"]["command"] == "--cid=140 --speed=0.5 --rate=${RATE:-2} --faster=${FASTER:-0.5}"
    mapped = {"SPEED": "0.5", "TWICE": "0.50.5", "RATE": None, "MODE": "a$$b c"}
    assert services["mapped"]["environment"] == mapped
    assert services["listed"]["environment"] == ["OTHER=a$$b c", "RATE=4", "SPEED=0.5", "MODE=a$$b c"]
    assert services["listed"]["entrypoint"] == ["car", "--mode=a$$b c"]
    assert services["without"]["environment"] == {"SPEED": "0.5", "MODE": "a$$b c"}
    assert "all services: SPEED as the test sets it" in application.changes


def test_they_reach_nothing_else(application: Application) -> None:
    """A test cannot choose images, mounts or files of the host with them."""
    (volume,) = application.compose["services"]["mapped"]["volumes"][-1:]
    assert volume.startswith("${SPEED:-")


def commands(application: Application, folder: Path) -> dict[str, Command]:
    common = ("", "sil", "closed-loop", 10.0, "realtime", "host", 1, 140, "", "sil", "sandbox", ())
    made = Commands(Plan("t", "t", "t.dodo.yml", *common, application), folder, folder / "report", Slot(150))
    return {service.name: made.of(service) for service in application.services}


def test_processes_have_them(application: Application, tmp_path: Path) -> None:
    made = commands(application, tmp_path / "generated" / "t")
    assert made["mapped"].argv == ("./car", "--cid=150", "--speed=0.5", "--rate=8", "--faster=0.5")
    assert made["listed"].argv == ("./car", "--cid=150", "0.5")
    for command in made.values():
        assert {name: command.environment[name] for name in GIVEN} == GIVEN
    assert made["mapped"].environment["TWICE"] == "0.50.5"
    assert made["listed"].environment["OTHER"] == "a$b c"


@pytest.mark.slow
def test_compose_reads_them(application: Application, tmp_path: Path) -> None:
    (tmp_path / "copy.yml").write_text(
        "services:\n" + "".join(f"  {n}: {s!r}\n" for n, s in _readable(application).items()).replace("None", "null")
    )
    services = config(tmp_path, "-f", "copy.yml")
    for service in services.values():
        assert {name: service["environment"][name].replace("$$", "$") for name in GIVEN} == GIVEN
    assert services["mapped"]["command"] == ["--cid=140", "--speed=0.5", "--rate=8", "--faster=0.5"]


def _readable(application: Application) -> dict[str, dict[str, object]]:
    keys = ("command", "environment", "entrypoint")
    return {
        name: {"image": "x", **{key: service[key] for key in keys if key in service}}
        for name, service in application.compose["services"].items()
    }


TEXTS = st.lists(
    st.sampled_from(
        ["$A", "${A}", "${B}", "$$A", "$", "${A:-1}", "${B:-${A}}", "${A:+y}", "${B-x}", "${A+${B:-z}}", "}", "a "]
    )
).map("".join)


@given(TEXTS, st.sampled_from(["", "1", "$B", "$$"]), st.sampled_from([{}, {"B": "2"}, {"B": ""}]))
def test_the_rest_is_left_for_compose(text: str, value: str, known: dict[str, str]) -> None:
    assert interpolate(with_values(text, {"A": value}), known) == interpolate(text, {**known, "A": value})


@pytest.mark.parametrize("name", ["PATH", "LD_PRELOAD", "ld_audit", "PYTHONPATH", "DODO_KEY", "CID", "OD4SESSION_CID"])
def test_what_a_test_may_not_set(name: str) -> None:
    assert owner(name)


@pytest.mark.parametrize("name", ["SPEED", "OMP_NUM_THREADS", "KEYPOINTS", "MODE"])
def test_what_a_test_may_set(name: str) -> None:
    assert not owner(name)
