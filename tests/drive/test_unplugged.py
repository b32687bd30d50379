"""Eight ways of pulling the plug in mid test, and two more: the outcome is error, and the rig comes to rest in time.

The whole stack runs: `dodo run` of hil-dynamic with the example application on the firmware's binary. The emulator is
the test's own, so that it goes on when those who use it are killed.
"""

import itertools
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from services.gantry.rig_table import ACCELERATION
from tests.drive.applications import results
from tests.drive.rig import REST, Hardware, Pose, Run, on_its_way, running

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("unplugged")]

BEGIN, AT_ONCE, REST_YAW = 0.55, 0.1, 0.05
"""s until braking begins, s in which a rig without current stands, rad/s below which it does (rotors swing)."""
SLACK = 0.05
"""s that this machine may be late with what it does and sees."""


def unplug(run: Run) -> None:
    run.rig.order("unplug")


def unplug_with_power(run: Run) -> None:
    run.rig.order("unplug power")


def kill_rig(run: Run) -> None:
    run.rig.process.kill()


def reset(run: Run) -> None:
    run.rig.order("reset")


def kill_gantry(run: Run) -> None:
    run.kill("services.gantry")


def stop_gantry(run: Run) -> None:
    run.kill("services.gantry", signal.SIGSTOP)


def kill_model(run: Run) -> None:
    run.kill("services.dynamic_model")


def stop_model(run: Run) -> None:
    run.kill("services.dynamic_model", signal.SIGSTOP)


def kill_sandbox(run: Run) -> None:
    run.kill("dodo_dsl.run.process.sandbox")


def kill_runner(run: Run) -> None:
    run.runner.kill()


@dataclass(frozen=True)
class Way:
    """What is done, and what is said then; a killed runner says nothing."""

    pull: Callable[[Run], None]
    reason: str
    isolation: str = "host"
    """As on a real rig."""
    begin: float = BEGIN
    """s until braking begins, or the rig stands."""


WAYS = (
    Way(unplug, "is lost: "),
    Way(unplug_with_power, "is lost: ", begin=AT_ONCE),
    Way(kill_rig, "is lost: "),
    Way(reset, "RESTARTED"),
    Way(kill_gantry, "service 'pose' of layer action was killed by SIGKILL"),
    Way(stop_gantry, "no Frame of the vehicle has come for 2 s"),
    Way(kill_model, "service 'vehicle' of layer action was killed by SIGKILL"),
    Way(stop_model, "no KinematicState of the vehicle has come for 1 s"),
    Way(kill_sandbox, "the test's sandbox ended unexpectedly"),
    Way(kill_runner, ""),
    Way(kill_runner, "", isolation="network"),
)


def brakes(before: Pose, poses: list[Pose], begin: float) -> None:
    """From ``begin`` s on it gets only slower, and it stands v / a later."""
    first = next(pose for pose in poses if pose.t >= before.t + begin + SLACK)
    for axis in ("vx", "vy"):
        speeds = [abs(getattr(pose, axis)) for pose in poses if pose.t >= first.t]
        assert all(after <= speed + 0.01 for speed, after in itertools.pairwise(speeds)), axis
    rests = max(first.speed / ACCELERATION["x"], abs(first.vyaw) / ACCELERATION["yaw"])
    last = next(pose for pose in poses if pose.t >= first.t + rests + SLACK)
    assert abs(last.vyaw) < REST_YAW
    assert last.speed < REST and (begin == BEGIN or first.speed < REST), (before, first, last)


def pulled(run: Run, way: Way) -> tuple[Pose, list[Pose]]:
    """The pose at which the plug was pulled, and those of the time in which the rig has to come to rest."""
    before = on_its_way(run.rig)
    seen = len(run.rig.poses)
    way.pull(run)
    if way.pull is not kill_rig:
        run.rig.until(lambda pose: pose.t > before.t + BEGIN + 1.5, 60)
    return before, run.rig.poses[seen - 1 :]


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


@pytest.fixture(scope="module")
def tries(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, firmware: None
) -> Iterator[dict[Way, "Future[None]"]]:
    """The ways that were asked for, three at a time: each mostly waits for its rig."""
    asked = [item.callspec.params["way"] for item in request.session.items if item.path == request.path]
    with ThreadPoolExecutor(3) as pool:
        yield {way: pool.submit(tried, tmp_path_factory.mktemp("way"), way) for way in asked}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way.pull.__name__}-{way.isolation}")
def test_the_outcome_is_error_and_the_rig_comes_to_rest(tries: dict[Way, "Future[None]"], way: Way) -> None:
    tries[way].result()


def tried(folder: Path, way: Way) -> None:
    with Hardware(folder / "port") as rig, running(folder, rig, way.isolation) as run:
        before, poses = pulled(run, way)
        if way.pull is not kill_rig:
            brakes(before, poses, way.begin)
        if way.reason:
            test = judged(run)
            assert test["outcome"] == "error"
            assert way.reason in test["reason"] + "\n".join(test["last_lines"]), test
        assert nothing_is_left(run)
