"""The rig by hand, as a process against a rig on a pseudo terminal."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.services.gantry.fakerig import FakeRig
from tests.services.process import ROOT


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[FakeRig]:
    with FakeRig(tmp_path / "rig") as one:
        yield one


def hand(rig: FakeRig, *words: str, code: int = 0) -> dict[str, Any]:
    command = [sys.executable, "-m", "services.gantry.manual", f"--serial={rig.path}", *words]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == code, result.stdout + result.stderr
    said: dict[str, Any] = json.loads(result.stdout)
    return said


def test_status_moves_nothing(rig: FakeRig) -> None:
    said = hand(rig, "status")
    assert (said["status"], said["word"], said["x"], said["y"]) == (0, "idle", 0.1, -0.1)
    assert not rig.commands("GOTO") and not rig.commands("CALIBRATE") and rig.last() == "STOP"


def test_it_goes_and_stops_at_the_end(rig: FakeRig) -> None:
    said = hand(rig, "goto", "-0.5", "0.25", "90")
    assert [said["x"], said["y"], said["yaw"]] == pytest.approx([-0.5, 0.25, 90], abs=0.01)
    assert rig.last() == "STOP"
    assert hand(rig, "home")["x"] == pytest.approx(-0.9, abs=0.01)


@pytest.mark.parametrize("words", [("goto", "2", "0", "0"), ("--range-x=0.5", "goto", "0", "0", "0")])
def test_out_of_the_ranges_nothing_moves(rig: FakeRig, words: tuple[str, ...]) -> None:
    assert "out of the rig's ranges" in hand(rig, *words, code=2)["error"]
    assert not rig.heard


@pytest.mark.parametrize("words", [(), ("dance",), ("goto", "1"), ("goto", "nan", "0", "0"), ("--cid=x", "status")])
def test_usage(rig: FakeRig, words: tuple[str, ...]) -> None:
    assert hand(rig, *words, code=2)["error"]
    assert not rig.heard


def test_uncalibrated(rig: FakeRig) -> None:
    rig.calibrated = False
    assert hand(rig, "status")["word"] == "not calibrated"
    assert "is not calibrated" in hand(rig, "goto", "0", "0", "0", code=1)["error"]
    assert not rig.commands("GOTO")
    assert hand(rig, "calibrate")["status"] == 0


def test_check_of_a_good_rig_and_of_one_that_loses_steps(rig: FakeRig) -> None:
    rig.homes_slowly, rig.at = True, [-0.85, -0.65, -2.5]
    said = hand(rig, "check")
    assert said["ok"] and {c["name"] for c in said["checks"]} >= {"answers", "latency", "homing x", "homing yaw"}
    rig.homes_slowly, rig.lost = False, 0.01
    said = hand(rig, "check", code=1)
    assert said["reason"].startswith("homing x is ")
