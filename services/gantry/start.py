"""Before a test begins: the rig is found, calibrated if that was asked for, and driven to its start."""

import math
import time
from collections.abc import Callable

from services.gantry.link import Link, RigError
from services.gantry.protocol import SENTENCES, Position, Status, Word, command

NEAR, NEAR_YAW = 0.005, math.radians(1.5)
"""m and rad within which the rig has reached a place: 1.5 degrees are less than a full step of the turn."""
POLL = 0.05
ASKING = command(Word.POSITION) + command(Word.STATUS)


def find(link: Link) -> Status:
    """The rig's status, as soon as it answers; raises RigError when it does not."""
    while True:
        _, status = link.exchange(ASKING, POLL)
        if status is not None:
            return status
        time.sleep(POLL)


def calibrate(link: Link, patience: float) -> None:
    """Let the rig find its home; raises RigError when it has not after ``patience`` s."""
    link.exchange(command(Word.CALIBRATE) + ASKING, POLL)
    _wait(link, patience, lambda _, status: status == Status.IDLE, "is not calibrated", (Status.NOT_CALIBRATED,))


def go(link: Link, goal: Position, patience: float) -> None:
    """Drive the rig to a place; raises RigError when it is not there after ``patience`` s."""
    link.exchange(command(Word.GOTO, goal.x, goal.y, goal.yaw) + ASKING, POLL)
    place = f"x = {goal.x:g} m, y = {goal.y:g} m, yaw = {math.degrees(goal.yaw):g} degrees"
    _wait(link, patience, lambda at, status: status == Status.IDLE and near(at, goal), f"has not reached {place}")


def near(at: Position | None, goal: Position) -> bool:
    """Whether a measured position is the goal, as exactly as the rig moves."""
    return at is not None and math.dist((at.x, at.y), (goal.x, goal.y)) < NEAR and abs(at.yaw - goal.yaw) < NEAR_YAW


def _wait(
    link: Link,
    patience: float,
    done: Callable[[Position | None, Status | None], bool],
    what: str,
    still: tuple[Status, ...] = (),
) -> None:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        at, status = link.exchange(ASKING, POLL)
        if done(at, status):
            return
        if status in SENTENCES and status not in still:
            raise RigError(f"the rig at {link.name} {SENTENCES[status]} (status {int(status)})")
        time.sleep(POLL)
    raise RigError(f"the rig at {link.name} {what} after {patience:g} s")
