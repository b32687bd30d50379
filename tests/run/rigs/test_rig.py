"""Tests on real rigs, with a rig on a pseudo terminal as the hardware: checked, driven, stopped, in quarantine."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.session import Session
from services.gantry.link import SerialPort
from tests.run.desk import gone
from tests.run.rigs.place import APPLICATION, Place, place
from tests.services.process import receive, running, send

__all__ = ["place"]
pytestmark = pytest.mark.realtime


def test_a_hil_test_on_a_real_rig(place: Place) -> None:
    test = place.test(code=0)
    assert test["outcome"] == "passed"
    assert len(place.rig.commands("CALIBRATE")) == 1, "the rig was checked"
    assert place.rig.last() == "STOP"
    alive = MessageSet.standard().id("dodo.Alive")
    recording = read_envelopes(place.folder / "dodo-report" / "hil-fake" / "test.rec")
    assert len([envelope for envelope in recording if envelope.data_type == alive]) >= 3


def drive(place: Place) -> "subprocess.Popen[bytes]":
    """A run whose vehicle moves the rig by now."""
    run = place.start("run", "hil-fake", *APPLICATION, "--backend", "process")
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


def stopped_and_left(place: Place) -> bool:
    """Whether the rig has been told to stop, and no process has it any more."""
    return gone(f"--serial={place.rig.path}", 10.0) and place.rig.last() == "STOP"


def test_whoever_is_killed_the_rig_is_stopped_and_then_free(place: Place) -> None:
    """Sandbox and runner at once; each alone, tests/drive/test_unplugged kills."""
    run = drive(place)
    os.kill(sandbox(run), signal.SIGKILL)
    run.kill()
    assert run.wait(20) == -signal.SIGKILL
    assert stopped_and_left(place) and not any(place.rig.velocity)
    assert "fake: the rig is idle" in place.dodo("rig", "status", "--wait", "10", code=0)


def test_what_a_killed_runner_leaves_misses_it_and_stops_the_rig(place: Place, cid: int, tmp_path: Path) -> None:
    """As containers do, which nothing ends when `dodo run` is killed."""
    live = "import asyncio\nfrom pathlib import Path\nfrom dodo_dsl.run.announce import heartbeat\nasync def main():\n"
    folder = f"Path({str(tmp_path)!r})"
    live += f" async with heartbeat({cid}, {folder}):\n  await asyncio.sleep(60)\nasyncio.run(main())\n"
    runner = subprocess.Popen([sys.executable, "-c", live])
    place.rig.at = [0.0, 0.0, 0.0]
    flags = f"--cid={cid}", f"--serial={place.rig.path}", "--limits=y=1"
    with Session(cid) as session, running("gantry", tmp_path, *flags) as gantry:
        ready = time.time_ns() // 1000
        while receive(session, "dodo.Alive")[0].sent < ready:
            pass  # the gantry was not there yet
        while not any(place.rig.velocity):
            assert gantry.poll() is None
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


def test_a_check_whose_runner_is_killed_stops_the_rig(place: Place) -> None:
    run = place.start("run", "hil-fake", *APPLICATION, "--backend", "process")
    while not place.rig.commands("CALIBRATE"):
        assert run.poll() is None
        time.sleep(0.02)
    run.kill()
    run.wait()
    assert stopped_and_left(place)
    assert "the rig is " in place.dodo("rig", "status", "--wait", "60", code=0)


def test_what_says_nothing_about_the_rig_does_not_quarantine_it(place: Place) -> None:
    with contextlib.closing(SerialPort(str(place.rig.path))):
        reason = place.test(code=3)["reason"]
    assert reason.startswith("rig 'fake' cannot be checked: the line to the rig at ")
    assert "lock" in reason or "busy" in reason
    assert not list((place.folder / "state").glob("*"))


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # docker's, of a socket that refuses
def test_unplugged_in_mid_test_and_then_quarantined(place: Place) -> None:
    over = threading.Event()

    def pull() -> None:
        while not any(place.rig.velocity) and not over.wait(0.02):
            pass
        place.rig.unplug()

    puller = threading.Thread(target=pull)
    puller.start()
    try:
        test = place.test(code=3)
    finally:
        over.set()
        puller.join()
    assert test["outcome"] == "error" and "is lost: " in test["reason"] + "".join(test["last_lines"])
    assert not list((place.folder / "state").glob("*"))
    place.rig.plug()
    place.rig.status = 4
    reason = place.test(code=3)["reason"]
    assert "rig 'fake' is in quarantine" in reason and "lost steps" in reason
    assert place.rig.status == 4
    assert "in quarantine" in place.dodo("rig", "status", code=1)
    assert "PROBLEM  rig fake" in place.dodo("doctor", code=1)
    place.dodo("rig", "clear", "fake", code=0)
    assert "quarantine" not in place.dodo("rig", "status", code=0)
