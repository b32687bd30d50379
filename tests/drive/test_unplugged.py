"""Eight ways of pulling the plug in mid test, and two more: the outcome is error, and the rig comes to rest in time.

The whole stack runs: `dodo run` of hil-dynamic with the example application on the firmware's binary. The emulator is
the test's own, so that it goes on when those who use it are killed.
"""

import itertools
import signal
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import pytest

from services.gantry.rig_table import ACCELERATION
from tests.drive.applications import results
from tests.drive.rig import REST, Hardware, Pose, Run, at_its_start, on_its_way, running

pytestmark = pytest.mark.realtime

BEGIN, AT_ONCE, REST_YAW = 0.55, 0.1, 0.05
"""s until braking begins, s in which a rig without current stands, rad/s below which it does (rotors swing)."""
SLACK = 0.05
"""s that an idle machine may be late with what it does and sees."""
CHAIN = 3
"""Programs, one after the other, through which a fault gets to the rig; each may be as late as this one is."""
MOST_LATE = 0.2
"""s: a machine that is later than that shows nothing of the rig, and the test fails."""


class Lateness:
    """How much too late this machine has woken a program that slept, at worst and in s, while it is entered."""

    def __init__(self) -> None:
        self.worst = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._sleep)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _sleep(self) -> None:
        while not self._over.is_set():
            begin = time.monotonic()
            time.sleep(0.002)
            self.worst = max(self.worst, time.monotonic() - begin - 0.002)


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


def pull(run: Run, verb: str, what: str) -> None:
    if verb == "order":
        run.rig.order(what)
    elif what in ("rig", "runner"):
        (run.rig.process if what == "rig" else run.runner).kill()
    else:
        run.kill(what, signal.SIGKILL if verb == "kill" else signal.SIGSTOP)


def brakes(at: float, poses: list[Pose], begin: float, slack: float) -> None:
    """From ``begin`` s after ``at`` on it gets only slower, and it stands v / a later."""
    first = next(pose for pose in poses if pose.t >= at + begin + slack)
    for axis in ("vx", "vy"):
        speeds = [abs(getattr(pose, axis)) for pose in poses if pose.t >= first.t]
        assert all(after <= speed + 0.01 for speed, after in itertools.pairwise(speeds)), axis
    rests = max(first.speed / ACCELERATION["x"], abs(first.vyaw) / ACCELERATION["yaw"])
    last = next(pose for pose in poses if pose.t >= first.t + rests + slack)
    assert abs(last.vyaw) < REST_YAW, (at, first, last, slack)
    assert last.speed < REST and (begin == BEGIN or first.speed < REST), (at, first, last, slack)


def pull_the_plug(run: Run, way: Way) -> None:
    """Pull it as the rig drives, and see it come to rest in its own time."""
    verb, _, what = way.pull.partition(" ")
    at_its_start(run)
    if "." in what:
        run.find(what)  # which takes a while
    on_its_way(run)
    with Lateness() as lateness:
        pull(run, verb, what)
        if way.pull == "kill rig":
            return
        at, seen = run.rig.now(), len(run.rig.poses)
        run.rig.until(lambda pose: pose.t > at + BEGIN, 60)
    slack = SLACK + min(CHAIN * lateness.worst, MOST_LATE)
    run.rig.until(lambda pose: pose.t > at + BEGIN + 2 * slack + 1.5, 60)
    brakes(at, run.rig.poses[seen - 1 :], way.begin, slack)


def judged(run: Run) -> dict[str, Any]:
    output = run.runner.communicate(timeout=120)[0]
    assert run.runner.returncode == 3 and "Traceback" not in output, output
    (test,) = results(run.folder / "dodo-report").values()
    return test


def nothing_is_left(run: Run) -> bool:
    end = time.monotonic() + 60
    while any(run.processes()) and time.monotonic() < end:
        time.sleep(0.05)
    return not any(run.processes())


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
