"""The health check before a test on a real rig: what puts the rig into quarantine, and what does not."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import Flag, Plan, PlannedService
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs import session
from dodo_dsl.run.rigs.leases import quarantined
from dodo_dsl.run.rigs.problems import ProgramTimeout, RigProblem
from dodo_dsl.run.rigs.session import CHECKS, examine
from tests.run.scripted import plan

GANTRY = (Flag("cid", "121"), Flag("serial", "/dev/ttyACM0"), Flag("range-x", "0.5"))
CAMERA = (Flag("source", "/dev/video0"), Flag("name", "video0", "memory"), Flag("width", "640"))
HUNG = ProgramTimeout("the rig's program gave no answer within 90 s")
FIT = {"ok": True}


class Programs:
    """What the programs of the checks answer, one after the other; errors are raised."""

    def __init__(self, *answers: dict[str, Any] | RigProblem) -> None:
        self.answers = list(answers)
        self.calls: list[list[str]] = []
        self.descriptors: set[tuple[int, ...]] = set()

    async def query(
        self, program: Sequence[str], words: Sequence[str], patience_s: float, descriptors: tuple[int, ...]
    ) -> dict[str, Any]:
        self.calls.append([*program[2:], *words])
        self.descriptors.add(descriptors)
        answer = self.answers.pop(0)
        if isinstance(answer, RigProblem):
            raise answer
        return answer


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    return tmp_path / "state"


def on_rig() -> Plan:
    pose = PlannedService("action", "pose", "gantry", "x", (), GANTRY)
    camera = PlannedService("environment", "camera", "camera", "x", (), CAMERA)
    other = PlannedService("environment", "clock", "other", "x", (), GANTRY)
    return replace(plan(), rig="kiwi", services=(camera, pose, other))


def problem(programs: Programs, monkeypatch: pytest.MonkeyPatch, tested: Plan | None = None) -> str:
    """Why a test cannot run; empty when it can."""
    monkeypatch.setattr(session, "query", programs.query)
    try:
        asyncio.run(examine(tested or on_rig(), lambda _: None, (7, 8)))
    except BackendError as error:
        return str(error)
    return ""


def test_programs_get_the_flags_of_the_test_and_hold_its_leases(monkeypatch: pytest.MonkeyPatch, state: Path) -> None:
    programs = Programs(FIT, FIT)
    assert problem(programs, monkeypatch) == ""
    assert programs.calls == [
        ["services.camera.health_check", "--source=/dev/video0", "--width=640"],
        ["services.gantry.manual", "--serial=/dev/ttyACM0", "--range-x=0.5", "check"],
    ]
    assert programs.descriptors == {(7, 8)}
    assert not state.exists()


ENDS = "('dodo rig clear kiwi' ends it)"
LOST, BUSY = "it has lost steps", RigProblem("it is busy")
CHECKED: dict[str, tuple[list[dict[str, Any] | RigProblem], str, str]] = {
    "unfit": ([FIT, {"ok": False, "reason": LOST}], f"rig 'kiwi' is in quarantine: {LOST} {ENDS}", LOST),
    "unfit without a reason": ([{}], "is in quarantine: its health check failed", "its health check failed"),
    "hung": ([HUNG], f"quarantine: its health check hung: {HUNG}", "its health check hung"),
    "busy": ([BUSY], f"rig 'kiwi' cannot be checked: {BUSY}", ""),
}
"""What the programs of the checks answer, why a test cannot run then, and why the rig is in quarantine."""


@pytest.mark.parametrize("case", CHECKED)
def test_what_a_check_leads_to(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    answers, said, reason = CHECKED[case]
    programs = Programs(*answers)
    found = problem(programs, monkeypatch)
    assert said in found and bool(said) == bool(found)
    assert quarantined("kiwi").startswith(reason) and bool(reason) == bool(quarantined("kiwi"))
    assert not programs.answers, "all were asked"
    if reason:
        assert (problem(programs, monkeypatch), len(programs.calls)) == (found, len(answers)), "checked no more"


def test_a_camera_that_reads_a_file_is_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = PlannedService("environment", "camera", "camera", "x", (), (Flag("file", "a.png", "path"),))
    programs = Programs()
    assert problem(programs, monkeypatch, replace(on_rig(), services=(camera,))) == ""
    assert programs.calls == []


def test_without_a_place_for_quarantines_no_test_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "file"))
    reason = problem(Programs(FIT, FIT), monkeypatch)
    assert reason == f"rig 'kiwi' cannot be checked: '{tmp_path}/file/kiwi.json' cannot be read: Not a directory"


def test_programs_of_the_checks_exist() -> None:
    for module, *_ in CHECKS.values():
        assert Path(__file__).parents[3].joinpath(*module.split(".")).with_suffix(".py").is_file()
