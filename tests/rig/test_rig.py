"""Rigs of a dodo.yml: by hand, under test and in quarantine, with a rig on a pseudo terminal as the hardware."""

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.cli.main import main
from tests.drive.applications import KIWI, ROOT, results
from tests.services.gantry.fakerig import FakeRig

CAMERA = {"map-path": "../maps/rig-straight", "z": "9.5 cm", "freq": "10 Hz"}
SPEC = {
    "dodo": 1,
    "name": "hil-fake",
    "extends": "../hil-dynamic/hil-dynamic.dodo.yml",
    "rig": "fake",
    "environment": {"camera": {"uses": "virtual-camera", "with": CAMERA}},
    "action": {"pose": {"with": {"truth-id": None}}},
}


class Place:
    """A folder with a dodo.yml that has the rig, and its state."""

    def __init__(self, folder: Path, cid: int, rig: FakeRig) -> None:
        self.folder, self.rig = folder, rig
        for name in ("maps", "sil-closed-straight", "hil-dynamic"):
            shutil.copytree(ROOT / "tests_registry" / name, folder / "tests" / name)
        (folder / "tests" / "hil-fake").mkdir()
        (folder / "tests" / "hil-fake" / "hil-fake.dodo.yml").write_text(yaml.safe_dump(SPEC, sort_keys=False))
        fake = {"kind": "dynamic", "cid": cid, "serial": str(rig.path), "limits": {"y": "1 m"}}
        deployment = {"dodo": 1, "registry": ["tests"], "rigs": {"fake": fake}}
        (folder / "dodo.yml").write_text(yaml.safe_dump(deployment))
        self.environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "DODO_RIGS": str(folder / "state"),
            "DODO_LEASES": str(folder / "leases"),
        }

    def command(self, *words: str) -> list[str]:
        return [sys.executable, "-m", "dodo_dsl", *words]

    def dodo(self, *words: str, code: int) -> str:
        result = subprocess.run(
            self.command(*words),
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=90,
        )
        assert result.returncode == code, result.stdout + result.stderr
        assert "Traceback" not in result.stdout + result.stderr
        return result.stdout + result.stderr

    def test(self, code: int) -> dict[str, Any]:
        application = str(KIWI / "docker-compose.yml")
        self.dodo("run", "hil-fake", "--application", application, "--backend", "process", code=code)
        (test,) = results(self.folder / "dodo-report").values()
        return test


@pytest.fixture
def place(tmp_path: Path, cid: int) -> Iterator[Place]:
    with FakeRig(tmp_path / "port") as rig:
        rig.at, rig.homes_slowly = [-0.88, -0.68, -2.6], True
        yield Place(tmp_path, cid, rig)


@pytest.mark.parametrize("action", ["status", "home", "goto", "calibrate", "clear", "truth"])
def test_every_action_has_help(action: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rig", action, "--help"], sys.stdout, sys.stderr) == 0
    assert "RIG" in capsys.readouterr().out


def test_by_hand(place: Place) -> None:
    assert "fake: the rig is idle, x = -0.880 m" in place.dodo("rig", "status", code=0)
    assert "x = 0.100 m, y = -0.200 m, yaw = 45.0 degrees" in place.dodo(
        "rig", "goto", "fake", "0.1", "-0.2", "45", code=0
    )
    (said,) = json.loads(place.dodo("rig", "status", "fake", "--json", code=0))
    assert (said["rig"], said["word"], said["quarantine"]) == ("fake", "idle", "")
    moves = len(place.rig.commands("GOTO"))
    assert "out of the rig's ranges" in place.dodo("rig", "goto", "fake", "0", "0.5", "0", code=2)
    assert len(place.rig.commands("GOTO")) == moves
    assert "there is no rig 'fke'" in place.dodo("rig", "home", "fke", code=2)


def test_one_user_at_a_time(place: Place) -> None:
    place.rig.status = 2  # busy for ever, so that the first goto stays
    first = subprocess.Popen(
        place.command("rig", "goto", "fake", "0", "0", "0"), cwd=place.folder, env=place.environment
    )
    while not place.rig.commands("GOTO"):
        time.sleep(0.02)
    said = place.dodo("rig", "status", "fake", "--wait", "0.3", code=3)
    assert "dodo rig goto" in said and "within 0.3 s" in said
    first.terminate()
    assert first.wait(20) == 130
    assert place.rig.last() == "STOP"


def test_a_hil_test_on_a_real_rig(place: Place) -> None:
    test = place.test(code=0)
    assert test["outcome"] == "passed"
    assert len(place.rig.commands("CALIBRATE")) > 1, "the rig was checked"
    assert place.rig.last() == "STOP"


def test_unplugged_in_mid_test_and_then_quarantined(place: Place) -> None:
    def pull() -> None:
        while not place.rig.commands("RUN"):
            time.sleep(0.02)
        place.rig.unplug()

    puller = threading.Thread(target=pull)
    puller.start()
    test = place.test(code=3)
    puller.join()
    assert test["outcome"] == "error" and "has been away for" in test["reason"] + "".join(test["last_lines"])
    assert not list((place.folder / "state").glob("*"))
    reason = "is no device"
    assert reason in place.test(code=3)["reason"]
    place.rig.plug()
    again = place.test(code=3)
    assert "rig fake is in quarantine" in again["reason"] and reason in again["reason"]
    assert "in quarantine" in place.dodo("rig", "status", code=1)
    assert "PROBLEM  rig fake" in place.dodo("doctor", code=1)
    place.dodo("rig", "clear", "fake", code=0)
    assert "quarantine" not in place.dodo("rig", "status", code=0)
