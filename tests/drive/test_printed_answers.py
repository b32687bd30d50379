"""Programs that print their answers, and the same program on the bus: equal answers, in lockstep and in real time."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from tests.drive.applications import ROOT, dodo

STEERING = "opendlv.proxy.GroundSteeringRequest"
EXAMPLE = ROOT / "examples" / "printing"
TEST = f"""\
dodo: 1
name: steer
description: Steer for each frame.
level: dil
kind: open-loop
timeout: 20 s
clock: lockstep
environment:
  camera: {{uses: rec-replay, with: {{rec: ../drive.rec}}}}
evaluation:
  signal:
    uses: continuous-signal
    with:
      {{message: {STEERING}, field: groundSteering, target: ../drive.rec, target-sender: 0, align: sample-time,
        max-mean: 10, min-samples: 15}}
"""
Rows = dict[int, float]

pytestmark = pytest.mark.slow


class Deployment:
    """A repository with one test on the first two seconds of a drive, and the example's program."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "tests" / "steer").mkdir(parents=True)
        (folder / "tests" / "steer" / "steer.dodo.yml").write_text(TEST)
        (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
        shutil.copy(EXAMPLE / "steering.py", folder)
        drive = ROOT / "tests_registry" / "recordings" / "kiwi-track.rec"
        self.dodo("rec", "cut", str(drive), "-o", "tests/drive.rec", "--end", "2")

    def dodo(self, *words: str) -> str:
        """The command's output, whatever becomes of the test."""
        return dodo(*words, code=(0, 1, 3), folder=self.folder)

    def write(self, *process: str, flags: str = "", **declared: object) -> None:
        """The application, with its program and keys of x-dodo, by default the lines of the example."""
        compose = yaml.safe_load((EXAMPLE / "docker-compose.yml").read_text())
        service = compose["services"]["steering"]
        service["command"] += flags
        service["x-dodo"] = declared or service["x-dodo"]
        service["x-dodo-process"] = list(process) or [sys.executable, "steering.py"]
        (self.folder / "docker-compose.yml").write_text(yaml.safe_dump(compose))

    def run(self, *flags: str) -> tuple[dict[str, object], Rows]:
        """The result, and the steering by sample time as it was recorded."""
        self.dodo("run", "steer", *flags)
        report = self.folder / "dodo-report"
        (test,) = json.loads((report / "results.json").read_text())["tests"]
        messages = MessageSet.standard()
        with Recording(report / "steer" / "test.rec") as recording:
            rows = [recording.envelope(row) for row in recording.rows([messages.id(STEERING)])]
        return test, {e.sample_time: messages.decode(e.data_type, e.payload).groundSteering for e in rows}


@pytest.fixture
def deployment(tmp_path: Path) -> Deployment:
    tmp_path.chmod(0o755)
    return Deployment(tmp_path)


def checks(test: dict[str, object]) -> object:
    return test["outcome"], test["checks"]


def test_where_the_world_waits_it_is_as_on_the_bus(deployment: Deployment) -> None:
    """Although the program never flushes; nothing is lost, and the log has the lines, too."""
    deployment.write(flags=" --bus", out=[STEERING])
    on_bus = deployment.run("--clock", "lockstep")
    deployment.write()
    printed = deployment.run("--clock", "lockstep")
    assert len(on_bus[1]) >= 15
    assert (checks(printed[0]), printed[1]) == (checks(on_bus[0]), on_bus[1])
    log = (deployment.folder / "dodo-report" / "steer" / "logs" / "application.steering.log").read_text()
    assert log.splitlines()[0].startswith("group_06;") and log.count("group_06") >= len(printed[1])
    assert "\r" not in log
    if shutil.which("g++"):
        program = deployment.folder / "steering"
        subprocess.run(["g++", "-O2", "-o", program, EXAMPLE / "steering.cpp"], check=True)
        deployment.write("./steering")
        in_cpp = deployment.run("--clock", "lockstep")
        assert (checks(in_cpp[0]), in_cpp[1]) == (checks(on_bus[0]), on_bus[1])


def test_in_real_time_each_frame_has_the_same_answer(deployment: Deployment) -> None:
    deployment.write()
    lockstep = sorted(deployment.run()[1].values())
    _, rows = deployment.run("--clock", "realtime")
    assert len(rows) > 1
    assert set(rows.values()) <= set(lockstep)
