"""Eight ways of pulling the plug in mid test, and two more: the outcome is error, and the rig comes to rest in time.

The whole stack runs: `dodo run` of hil-dynamic with the example application on the firmware's binary. The emulator is
the test's own, in real time as hardware, so that it goes on when those who use it are killed.
"""

import contextlib
import itertools
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import pytest
import yaml

from services.gantry.emulator import START
from services.gantry.rig_table import ACCELERATION
from tests.drive.applications import KIWI, ROOT, results
from tests.drive.variants import registry, variant
from tests.realtime import hurry, wait_for_nobody

pytestmark = pytest.mark.realtime

BUILT = ROOT / "build" / "firmware"
REST = 0.005
"""m/s below which a rig stands."""


Runner = subprocess.Popen[str]
"""``dodo run`` as a process, with its output."""


class Pose(NamedTuple):
    """When (s, the rig's time), where (m, m, rad) and how fast (m/s, m/s, rad/s) it truly is."""

    t: float
    x: float
    y: float
    yaw: float
    vx: float
    vy: float
    vyaw: float

    @property
    def speed(self) -> float:
        return max(abs(self.vx), abs(self.vy))


class Hardware:
    """The emulator with a port at ``path``; it runs until the end of the block."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.poses: list[Pose] = []
        self._answers = 0
        words = [BUILT / "rig-emulator", "--start", START, "--link", path, BUILT / "gantry.elf"]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        wait_for_nobody(self.process.pid)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdin is not None
        self.process.stdin.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                said = json.loads(line)
                if "x" in said:
                    self.poses.append(Pose(*(float(said[name]) for name in Pose._fields)))
                elif "ramp" in said:
                    self._answers += 1

    def order(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def now(self) -> float:
        """The rig's time, in s, once it has done all that it was ordered."""
        known = self._answers
        self.order("extremes")
        self.until(lambda _: self._answers > known, 60)
        return self.poses[-1].t

    def until(self, true: Callable[[Pose], bool], patience: float, runner: "Runner | None" = None) -> Pose:
        """The first pose from now on for which something is true; a ``runner`` that ends before has failed."""
        seen, end = len(self.poses), time.monotonic() + patience
        while time.monotonic() < end:
            for pose in self.poses[seen:]:
                if true(pose):
                    return pose
            if runner is not None and runner.poll() is not None:
                raise AssertionError(f"dodo run ended before the rig did it: {runner.communicate()[0]}")
            seen = len(self.poses)
            time.sleep(0.01)
        raise AssertionError(f"the rig did not come to do it within {patience:g} s: {self.poses[-1:]}")


@dataclass
class Run:
    """`dodo run` of the one test in a folder, on a rig."""

    folder: Path
    rig: Hardware
    runner: Runner

    def processes(self) -> list[Path]:
        """All of this very run; a service that was forked has the runner's variables."""
        return [
            each for each in Path("/proc").glob("[0-9]*") if f"DODO_RIGS={self.folder}/state" in words(each, "environ")
        ]

    def find(self, module: str) -> int:
        """The one process that was started to run a module."""
        return next(int(each.name) for each in self.processes() if module in words(each, "cmdline"))


def words(process: Path, file: str) -> list[str]:
    with contextlib.suppress(OSError):
        return (process / file).read_bytes().decode(errors="replace").split("\0")
    return []


@contextlib.contextmanager
def running(folder: Path, rig: Hardware, isolation: str) -> Iterator[Run]:
    """hil-dynamic, as test `unplugged`, on a rig as if it were the emulated one, which needs no check."""
    camera = {"camera": {"with": {"frame-id": 0}}}
    pose = {"pose": {"with": {"serial": str(rig.path), "calibrate": True, "truth-id": None}}}
    variant(registry(folder), "hil-dynamic", "unplugged", isolation=isolation, environment=camera, action=pose)
    (folder / "dodo.yml").write_text(yaml.safe_dump({"dodo": 1, "registry": ["tests"]}))
    command = ["run", "unplugged", "--backend", "process", "--application", str(KIWI / "docker-compose.yml")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DODO_RIGS": str(folder / "state")}
    runner = subprocess.Popen(
        [sys.executable, "-m", "dodo_dsl", *command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    hurry(runner.pid)
    try:
        yield Run(folder, rig, runner)
    finally:
        with contextlib.suppress(subprocess.TimeoutExpired):
            runner.communicate(timeout=60)
        runner.kill()
        runner.communicate()


def at_its_start(run: Run) -> Pose:
    """The pose at which it stands and waits for the drive."""
    start = math.radians(-34)
    return run.rig.until(
        lambda pose: pose.speed < REST and abs(pose.y) < 0.01 and abs(pose.yaw - start) < 0.2, 120, run.runner
    )


def on_its_way(run: Run) -> Pose:
    """The pose at which it drives, after it has stood at its start."""
    at_its_start(run)
    return run.rig.until(lambda pose: pose.vx > 0.2, 120, run.runner)


BEGIN, AT_ONCE, REST_YAW = 0.55, 0.1, 0.05
"""s until braking begins, s in which a rig without current stands, rad/s below which it does (rotors swing)."""
SLACK = 0.25
"""s that a machine may be late with what it does and sees: more shows nothing of the rig, and the test fails."""


GANTRY, MODEL, SANDBOX = "services.gantry", "services.dynamic_model", "dodo_dsl.run.process.sandbox"


@dataclass(frozen=True)
class Way:
    """What is done: an order to the rig, or a signal to a program; and what is said then, a killed runner nothing."""

    pull: str
    reason: str
    isolation: str = "host"
    """As on a real rig."""
    begin: float = BEGIN
    """s until braking begins, or the rig stands."""
    short: bool = False
    """Whether ``make test`` does it; the others end in the same way, and are for ``make proof``."""


KILLED = "was killed by SIGKILL"
WAYS = (
    Way("order unplug", "is lost: ", short=True),
    Way("order unplug power", "is lost: ", begin=AT_ONCE),
    Way("kill rig", "is lost: "),
    Way("order reset", "RESTARTED"),
    Way(f"kill {GANTRY}", f"service 'pose' of layer action {KILLED}"),
    Way(f"stop {GANTRY}", "no Frame of the vehicle has come for 2 s", short=True),
    Way(f"kill {MODEL}", f"service 'vehicle' of layer action {KILLED}"),
    Way(f"stop {MODEL}", "no KinematicState of the vehicle has come for 1 s"),
    Way(f"kill {SANDBOX}", "the test's sandbox ended unexpectedly"),
    Way("kill runner", ""),  # in short in tests/run/rigs/test_rig.py
    Way("kill runner", "", isolation="network"),
)


def brakes(at: float, poses: list[Pose], begin: float) -> None:
    """From ``begin`` s after ``at`` on it gets only slower, and it stands v / a later."""
    first = next(pose for pose in poses if pose.t >= at + begin + SLACK)
    for axis in ("vx", "vy"):
        speeds = [abs(getattr(pose, axis)) for pose in poses if pose.t >= first.t]
        assert all(after <= speed + 0.01 for speed, after in itertools.pairwise(speeds)), axis
    rests = max(first.speed / ACCELERATION["x"], abs(first.vyaw) / ACCELERATION["yaw"])
    last = next(pose for pose in poses if pose.t >= first.t + rests + SLACK)
    assert abs(last.vyaw) < REST_YAW, (at, first, last)
    assert last.speed < REST and (begin == BEGIN or first.speed < REST), (at, first, last)


def pull_the_plug(run: Run, way: Way) -> None:
    """Pull it as the rig drives, and see it come to rest in its own time."""
    verb, _, what = way.pull.partition(" ")
    at_its_start(run)
    known = {"rig": run.rig.process.pid, "runner": run.runner.pid}
    process = 0 if verb == "order" else known.get(what) or run.find(what)
    on_its_way(run)
    if process:
        os.kill(process, signal.SIGKILL if verb == "kill" else signal.SIGSTOP)
    else:
        run.rig.order(what)
    if way.pull == "kill rig":
        return
    at, seen = run.rig.now(), len(run.rig.poses)
    run.rig.until(lambda pose: pose.t > at + BEGIN + 2 * SLACK + 1.5, 60)
    brakes(at, run.rig.poses[seen - 1 :], way.begin)


def judged(run: Run) -> dict[str, Any]:
    output = run.runner.communicate(timeout=120)[0]
    assert run.runner.returncode == 3 and "Traceback" not in output, output
    (test,) = results(run.folder / "dodo-report").values()
    return test


def nothing_is_left(run: Run) -> bool:
    end = time.monotonic() + 60
    while run.processes() and time.monotonic() < end:
        time.sleep(0.05)
    return not run.processes()


@pytest.mark.usefixtures("firmware")
@pytest.mark.parametrize(
    "way",
    [pytest.param(w, id=f"{w.pull}, {w.isolation}", marks=[] if w.short else [pytest.mark.proof]) for w in WAYS],
)
def test_the_outcome_is_error_and_the_rig_comes_to_rest(tmp_path: Path, way: Way) -> None:
    with Hardware(tmp_path / "port") as rig, running(tmp_path, rig, way.isolation) as run:
        pull_the_plug(run, way)
        if way.reason:
            test = judged(run)
            assert test["outcome"] == "error"
            assert way.reason in test["reason"] + "\n".join(test["last_lines"]), test
        assert nothing_is_left(run)
