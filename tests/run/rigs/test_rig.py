"""Rigs of a dodo.yml: by hand, under test and in quarantine, with a rig on a pseudo terminal as the hardware."""

import asyncio
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.cli.main import main
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import read_envelopes
from dodo_dsl.plan.plan_json import from_json
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs import rigs
from services.gantry.port import SerialPort
from tests.drive.applications import KIWI, ROOT, results
from tests.services.gantry.fake_rig import FakeRig
from tests.services.process import receive, running, send

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


def test_two_repositories_that_name_one_port_exclude_each_other(place: Place, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    rigs = {"theirs": {"kind": "dynamic", "cid": 3, "serial": str(place.rig.path.resolve())}}
    (other / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "rigs": rigs}))
    place.rig.status = 2
    first = subprocess.Popen(place.command("rig", "goto", "theirs", "0", "0", "0"), cwd=other, env=place.environment)
    while not place.rig.commands("GOTO"):
        time.sleep(0.02)
    said = place.dodo("rig", "status", "fake", "--wait", "0.3", code=3)
    assert "no device came free within 0.3 s; test 'dodo rig goto'" in said
    first.terminate()
    assert first.wait(20) == 130


def test_status_shows_a_fault_until_calibrate_acknowledges_it(place: Place) -> None:
    place.rig.status = 3
    for _ in range(2):
        assert "the rig touched a limit switch and stopped" in place.dodo("rig", "status", code=0)
    assert "touched a limit switch" in place.dodo("rig", "home", "fake", code=3)
    assert "the rig is idle" in place.dodo("rig", "calibrate", "fake", code=0)


def test_a_hil_test_on_a_real_rig(place: Place) -> None:
    test = place.test(code=0)
    assert test["outcome"] == "passed"
    assert len(place.rig.commands("CALIBRATE")) > 1, "the rig was checked"
    assert place.rig.last() == "STOP"
    alive = MessageSet.standard().id("dodo.Alive")
    recording = read_envelopes(place.folder / "dodo-report" / "hil-fake" / "test.rec")
    assert len([envelope for envelope in recording if envelope.data_type == alive]) >= 3


def test_a_real_rig_is_never_kept_up(place: Place) -> None:
    application = str(KIWI / "docker-compose.yml")
    said = place.dodo("run", "hil-fake", "--application", application, "--keep", code=2)
    assert "hil-fake runs on rig 'fake', which --keep would leave driven" in said
    assert not place.rig.received


def drive(place: Place) -> "subprocess.Popen[bytes]":
    """A run whose vehicle moves the rig by now."""
    words = ("run", "hil-fake", "--application", str(KIWI / "docker-compose.yml"), "--backend", "process")
    run = subprocess.Popen(place.command(*words), cwd=place.folder, env=place.environment, stdout=subprocess.DEVNULL)
    while not any(place.rig.velocity):
        assert run.poll() is None
        time.sleep(0.02)
    return run


def sandbox(run: "subprocess.Popen[bytes]") -> int:
    (found,) = (
        int(name)
        for name in Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
        if b"dodo_dsl.run.process.sandbox" in Path(f"/proc/{name}/cmdline").read_bytes()
    )
    return found


def on_the_rig(place: Place) -> list[str]:
    """The processes that have to do with the rig's port."""
    word = f"--serial={place.rig.path}".encode()
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if word in (entry / "cmdline").read_bytes().split(b"\0"):
                found.append(entry.name)
    return found


@pytest.mark.parametrize("killed", ["sandbox", "runner", "both"])
def test_whoever_is_killed_the_rig_is_stopped_and_then_free(place: Place, killed: str) -> None:
    run = drive(place)
    inner = sandbox(run)
    if killed != "runner":
        os.kill(inner, signal.SIGKILL)
    if killed != "sandbox":
        run.kill()
    assert run.wait(20) == (3 if killed == "sandbox" else -signal.SIGKILL)
    end = time.monotonic() + 10
    while on_the_rig(place) and time.monotonic() < end:
        time.sleep(0.05)
    assert not on_the_rig(place)
    assert place.rig.last() == "STOP" and not any(place.rig.velocity)
    assert "fake: the rig is idle" in place.dodo("rig", "status", "--wait", "10", code=0)
    if killed == "sandbox":
        (test,) = results(place.folder / "dodo-report").values()
        assert (test["outcome"], test["reason"]) == ("error", "the test's sandbox ended unexpectedly")


def test_what_a_killed_runner_leaves_misses_it_and_stops_the_rig(place: Place, cid: int, tmp_path: Path) -> None:
    """As containers do, which nothing ends when `dodo run` is killed."""
    live = "import asyncio\nfrom dodo_dsl.run.announce import signs_of_life\n"
    live += f"async def main():\n async with signs_of_life({cid}):\n  await asyncio.sleep(60)\nasyncio.run(main())\n"
    runner = subprocess.Popen([sys.executable, "-c", live], env=place.environment)
    place.rig.at = [0.0, 0.0, 0.0]
    with Session(cid) as session, running("gantry", tmp_path, f"--cid={cid}", f"--serial={place.rig.path}") as gantry:
        ready = time.time_ns() // 1000
        while receive(session, "dodo.Alive")[0].sent < ready:
            pass  # the gantry was not there yet
        while not any(place.rig.velocity):
            send(session, "opendlv.sim.KinematicState", vx=0.05)
            time.sleep(0.02)
        runner.kill()
        runner.wait()
        while gantry.poll() is None:
            send(session, "opendlv.sim.KinematicState", vx=0.05)
            time.sleep(0.02)
        assert gantry.stderr is not None
        assert "the runner has given no sign of life for 3 s" in gantry.stderr.read()
    assert gantry.returncode == 1 and place.rig.last() == "STOP"


def test_who_checks_the_rig_holds_its_lease(place: Place) -> None:
    words = ("run", "hil-fake", "--application", str(KIWI / "docker-compose.yml"), "--backend", "process")
    run = subprocess.Popen(place.command(*words), cwd=place.folder, env=place.environment, stdout=subprocess.DEVNULL)
    while not place.rig.commands("CALIBRATE"):
        time.sleep(0.02)
    run.kill()
    run.wait()
    assert on_the_rig(place), "the check goes on"
    assert "came free within 0.3 s" in place.dodo("rig", "status", "--wait", "0.3", code=3)
    assert "the rig is " in place.dodo("rig", "status", "--wait", "60", code=0)


def test_what_says_nothing_about_the_rig_does_not_quarantine_it(place: Place) -> None:
    with contextlib.closing(SerialPort(str(place.rig.path))):
        reason = place.test(code=3)["reason"]
    assert reason.startswith("rig fake cannot be checked: the line to the rig at ")
    assert "lock" in reason or "busy" in reason
    place.rig.unplug()
    assert place.test(code=3)["reason"].startswith("rig fake cannot be checked: '")
    assert not list((place.folder / "state").glob("*"))


def test_unplugged_in_mid_test_and_then_quarantined(place: Place) -> None:
    def pull() -> None:
        while not any(place.rig.velocity):
            time.sleep(0.02)
        place.rig.unplug()

    puller = threading.Thread(target=pull)
    puller.start()
    test = place.test(code=3)
    puller.join()
    assert test["outcome"] == "error" and "is lost: " in test["reason"] + "".join(test["last_lines"])
    assert not list((place.folder / "state").glob("*"))
    place.rig.plug()
    place.rig.status = 4
    for _ in range(2):
        reason = place.test(code=3)["reason"]
        assert "rig fake is in quarantine" in reason and "lost steps" in reason
    assert place.rig.status == 4
    assert "in quarantine" in place.dodo("rig", "status", code=1)
    assert "PROBLEM  rig fake" in place.dodo("doctor", code=1)
    place.dodo("rig", "clear", "fake", code=0)
    assert "quarantine" not in place.dodo("rig", "status", code=0)


def test_a_check_that_hangs_twice_quarantines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hanging.py").write_text("import time\nopen('tries', 'a').write('.')\ntime.sleep(60)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    monkeypatch.setattr(rigs, "CHECKS", {"gantry": ("hanging", (), ())})
    monkeypatch.setattr(rigs, "CHECK_PATIENCE_S", 1.0)
    golden = ROOT / "tests" / "compiler" / "golden" / "hil-dynamic" / "test.json"
    plan = replace(from_json(golden.read_text()), rig="fake")
    with pytest.raises(BackendError, match="its check hung 2 times: the rig's program gave no answer within 1 s"):
        asyncio.run(rigs.examine(plan, lambda _: None, ()))
    assert (tmp_path / "tries").read_text() == ".." and rigs.quarantined("fake")
