"""Rigs that a repository, a job or a number would move unasked."""

import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl import state_folder
from dodo_dsl.plan.model import Flag, PlannedService
from dodo_dsl.run import leases
from dodo_dsl.run.rigs import leases as rigs_leases
from services.gantry import manual
from services.gantry.protocol import answer
from tests.hostile.command import dodo
from tests.run.helpers import Bench
from tests.run.rigs.place import Place, place

__all__ = ["place"]
NUMBERS = ("1_0", "1e1_0", "١", "１", "0x10", "1 0", "ten", "1-", "1,5", "nan", "inf", "1e999", "²")
"""Python's ``float`` or ``int`` takes some of these; no person writes them."""


def goto(text: str) -> str:
    code, output = dodo("rig", "goto", "emulated", text, "0", "0")
    assert code == 2
    return output


def the_rig_s_program(text: str) -> str:
    output = StringIO()
    assert manual.main(["--serial=/dev/null", "goto", "0", text, "0"], output) == 2
    return output.getvalue()


PLACES: dict[str, Callable[[str], str]] = {
    "dodo rig goto": goto,
    "dodo rig --wait": lambda text: dodo("rig", "home", "emulated", "--wait", text)[1],
    "the rig's program": the_rig_s_program,
}


@pytest.mark.thorough
@pytest.mark.parametrize("text", NUMBERS[::4])
@pytest.mark.parametrize("where", PLACES)
def test_numbers_that_only_python_reads(where: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers that only Python would read, such as 1_0, are refused."""
    said = PLACES[where](text) + capsys.readouterr().err
    assert "not" in said or "takes 3 numbers" in said or "expected" in said, said


@pytest.mark.parametrize("text", NUMBERS)
def test_the_serial_line_has_no_such_numbers(text: str) -> None:
    """The gantry's serial line takes no such numbers either."""
    assert answer(f"$0.1,{text},0.2") is None
    assert answer(f"${text}") is None


# Devices


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository whose rig is a device that no program moves."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    answers = {"says": "the rig is idle", "x": None}
    asked = contextlib.nullcontext(lambda _: answers)
    monkeypatch.setattr("dodo_dsl.run.rigs.access.occupied", lambda *_: asked)
    return tmp_path


def rig(folder: Path, name: str = "fake", port: str = "/dev/null") -> None:
    about = {"kind": "dynamic", "cid": 121, "serial": port}
    (folder / "dodo.yml").write_text(json.dumps({"dodo": 1, "rigs": {name: about}}))


def test_a_rig_with_another_name_stays_in_quarantine(repository: Path) -> None:
    rigs_leases.quarantine("fake", "it has lost steps", ["/dev/null"])
    (repository / "link").symlink_to("/dev/null")
    for name, port in (("fake", "/dev/null"), ("renamed", "/dev/null"), ("linked", str(repository / "link"))):
        rig(repository, name, port)
        assert "in quarantine: it has lost steps" in dodo("rig", "status", "--wait", "0")[1]
    rig(repository, "other", "/dev/zero")
    assert "in quarantine" not in dodo("rig", "status", "--wait", "0")[1]
    rig(repository, "renamed")
    assert dodo("rig", "clear", "renamed")[0] == 0
    rig(repository)
    assert "in quarantine" not in dodo("rig", "status", "--wait", "0")[1]
    assert rigs_leases.all_quarantined() == {}


def test_no_variable_moves_what_all_users_of_a_computer_share(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root makes the folder, and a group may write it."""
    shared = repository / "shared"
    for name in ("rigs", "leases"):
        (shared / name).mkdir(parents=True)
    monkeypatch.setattr(state_folder, "SHARED", shared)
    rigs_leases.quarantine("fake", "it has lost steps", ["/dev/null"])
    for name in ("DODO_RIGS", "DODO_LEASES", "XDG_STATE_HOME", "HOME"):
        monkeypatch.setenv(name, str(repository / "mine"))
    assert rigs_leases.quarantined("renamed", ["/dev/null"]) == "it has lost steps"
    lease = leases.try_lease("cid-121", {})
    assert lease is not None and lease.record.parent == shared / "leases"
    lease.release()
    assert not (repository / "mine").exists()


@pytest.mark.parametrize("rig_name", ["", "emulated"])
@pytest.mark.parametrize("port", ["/dev/ttyACM0"])
@pytest.mark.thorough
def test_a_compiled_test_moves_no_hardware_without_a_rig(tmp_path: Path, rig_name: str, port: str) -> None:
    plan = Bench(tmp_path).plan()
    moves = PlannedService("action", "pose", "gantry", "x", ("python",), (Flag("serial", port),))
    for isolation in (None, "host"):
        bench = Bench(tmp_path, isolation)
        (outcome,) = bench.run(replace(plan, rig=rig_name, services=(*plan.services, moves)))
        words = f"service 'pose' would move what is at '{port}', and the test runs on no rig"
        assert (outcome.outcome, outcome.reason) == ("error", words)


# Masters


@pytest.mark.realtime
def test_a_rig_whose_command_is_killed_stops(place: Place) -> None:
    """A rig stops when the command that moves it is killed."""
    place.rig.status = 2
    process = place.start("rig", "goto", "fake", "0.5", "0", "0")
    while not place.rig.commands("GOTO"):
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    end = time.monotonic() + 10
    while place.rig.last() != "STOP":
        assert time.monotonic() < end, "the rig goes on"
        time.sleep(0.02)
    place.rig.status = 0
    assert "fake: the rig is idle" in place.dodo("rig", "status", "--wait", "10", code=0)
