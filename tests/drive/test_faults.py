"""A bad network and a wall clock that jumps, while the services drive a car along a straight track."""

import os
import re
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from tests.drive.applications import ROOT, results
from tests.faults import Book
from tests.realtime import hurry
from tests.run.desk import processes_with, wait_for

pytestmark = pytest.mark.realtime

SHIMS = Path(__file__).parent / "shims"
SPEC = """
dodo: 1
name: sil-blind
description: Drive straight on along a straight track, without looking.
level: sil
kind: closed-loop
timeout: 30 s
action:
  vehicle: {uses: dynamic-model, with: {freq: 100 Hz}}
  pose:    {uses: integrator, with: {freq: 100 Hz, x: 0 m, y: 0 m, yaw: 90 deg}}
evaluation:
  track: {uses: collision, with: {map-path: ../maps/straight, goal: finish, walls: [left, right], max-time: 25 s}}
"""
APPLICATION = """
import sys, time
from dodo_dsl.opendlv.session import Session
with Session(int(sys.argv[1].partition("=")[2])) as bus:
    send = bus.messages.type
    while True:
        bus.send(send("opendlv.proxy.GroundSteeringRequest")(groundSteering=0.0))
        bus.send(send("opendlv.proxy.PedalPositionRequest")(position=0.3))
        print(f"clock {time.time():.0f}", flush=True)
        time.sleep(0.1)
"""
HOUR = 3600


@pytest.fixture
def words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The command that runs the drive in namespaces."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    spec = tmp_path / "tests" / "sil-blind" / "sil-blind.dodo.yml"
    spec.parent.mkdir(parents=True)
    spec.write_text(SPEC)
    shutil.copytree(ROOT / "tests_registry" / "maps", tmp_path / "tests" / "maps")
    (tmp_path / "blind.py").write_text(APPLICATION)
    shutil.copy(SHIMS / "sitecustomize.py", tmp_path)
    said = {"out": ["opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"]}
    passed = ["DODO_TEST_NETWORK", "DODO_TEST_CLOCK"]
    (tmp_path / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "registry": ["tests"], "environment": passed}))
    service = {
        "image": "x",
        "command": "--cid=111",
        "environment": passed,
        "x-dodo": said,
        "x-dodo-process": ["python", str(tmp_path / "blind.py")],
    }
    (tmp_path / "docker-compose.yml").write_text(yaml.safe_dump({"services": {"blind": service}}))
    application = ["--application", str(tmp_path / "docker-compose.yml")]
    return [sys.executable, "-m", "dodo_dsl", "run", str(spec), *application, "--report", str(tmp_path / "report")]


def start(words: list[str], **variables: str) -> "subprocess.Popen[str]":
    process = subprocess.Popen(
        words,
        cwd=Path(words[-1]).parent,
        env={**os.environ, "PYTHONPATH": f"{Path(words[-1]).parent}:{ROOT}", **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    hurry(process.pid)
    return process


def left(folder: Path) -> list[str]:
    """Leases, and the application's process, where a test left them behind."""
    return [path.name for path in (folder / "leases").glob("*.json")] + processes_with(str(folder / "blind.py"))


def test_bad_network(words: list[str], tmp_path: Path, book: Book) -> None:
    """Lost and late messages cost the drive some smoothness, and the verdict nothing."""
    out, _ = start(words, DODO_TEST_NETWORK="bad").communicate(timeout=300)
    test = results(tmp_path / "report")["sil-blind"]
    assert test["outcome"] == "passed", out
    messages = MessageSet.standard()
    envelopes = list(read_envelopes(tmp_path / "report" / "sil-blind" / "test.rec"))
    pedals = [e for e in envelopes if e.data_type == messages.id("opendlv.proxy.PedalPositionRequest")]
    assert min(e.received - e.sent for e in pedals) > 45_000
    frames = [e.sample_time for e in envelopes if e.data_type == messages.id("opendlv.sim.Frame")]
    assert len(frames) < (max(frames) - min(frames)) // 10_000
    assert left(tmp_path) == []
    book.record("5% of all messages are lost, the others come 50 ms late", "process", test["outcome"], test["reason"])


def test_wall_clock_that_jumps(words: list[str], tmp_path: Path, book: Book) -> None:
    """An hour ahead and an hour back, for all processes of the run at once.

    It is right again at the end: when a service left is compared with the kernel's times of datagrams.
    """
    clock = tmp_path / "clock"
    clock.write_bytes(struct.pack("q", 0))
    run = start(words, DODO_TEST_CLOCK=str(clock))
    wait_for(run, "running")
    for seconds in (HOUR, -HOUR, 0):
        time.sleep(1.0)
        with clock.open("r+b") as file:
            file.write(struct.pack("q", seconds))
    out, _ = run.communicate(timeout=300)
    test = results(tmp_path / "report")["sil-blind"]
    assert test["outcome"] == "passed", out
    log = (tmp_path / "report/sil-blind/logs/application.blind.log").read_text()
    times = [int(seconds) for seconds in re.findall(r"^clock (\d+)$", log, re.MULTILINE)]
    assert max(times) - times[0] >= HOUR
    assert min(times) - times[0] <= -HOUR + 30
    assert left(tmp_path) == []
    book.record("The wall clock jumps", "process", test["outcome"], test["reason"])
