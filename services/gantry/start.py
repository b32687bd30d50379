"""Before a test begins: the rig is found, calibrated on request, and driven to its start."""

import math
import time
from collections.abc import Callable

from services.gantry.link import REQUEST_STATE, Link, RigError
from services.gantry.protocol import LATCHED, SENTENCES, Position, Word, command
from services.gantry.rig_table import Status

NEAR, NEAR_YAW = 0.005, math.radians(1.5)
"""m and rad within which the rig has reached a place: 1.5 degrees are less than a full step of the turn."""
POLL = 0.05
TRIES = 3
ANSWER = 0.25
"""s that the rig has to obey or refuse a command."""
_BEGIN = 1.0
"""s within which the rig has to report that it looks for home."""


def find(link: Link) -> Status:
    """The rig's status, as soon as it answers, with any fault still latched; raises RigError when it does not."""
    while True:
        status = link.exchange(REQUEST_STATE, POLL).status
        if status is not None:
            return status
        time.sleep(POLL)


def settle(link: Link, status: Status) -> None:
    """Stop the rig, and acknowledge that it braked; raises RigError for a fault, which only CALIBRATE ends."""
    if status in LATCHED:
        raise RigError(trouble(link, status))
    give(link, Word.STOP)


def trouble(link: Link, status: Status) -> str:
    return f"the rig at {link.name} {SENTENCES[status]} (status {int(status)})"


def give(link: Link, word: Word, *arguments: float) -> Status | None:
    """Give a command; the status after it, None when that did not come. Raises RigError when it is refused."""
    answers = link.exchange(command(word, *arguments) + command(Word.STATUS), ANSWER)
    if answers.refusals:
        raise RigError(f"the rig at {link.name} refuses {word}: {answers.refusals[0]}")
    return answers.status


def calibrate(link: Link, patience: float) -> None:
    """Let the rig find its home; raises RigError when it has not after ``patience`` s."""
    begin = time.monotonic()
    homing = give(link, Word.CALIBRATE) == Status.HOMING

    def done(_: Position | None, status: Status | None) -> bool:
        nonlocal homing
        homing |= status == Status.HOMING
        if not homing and time.monotonic() - begin > _BEGIN:
            raise RigError(f"the rig at {link.name} does not begin to find its home")
        return homing and status == Status.IDLE

    _wait(link, patience, done, "has not found its home", command(Word.STATUS))


def go(link: Link, goal: Position, patience: float) -> None:
    """Drive the rig to a true place; raises RigError when it is not there after ``patience`` s."""
    told = link.conversion.to_firmware(goal)
    give(link, Word.GOTO, told.x, told.y, told.yaw)
    place = f"x = {goal.x:g} m, y = {goal.y:g} m, yaw = {math.degrees(goal.yaw):g} degrees"
    _wait(link, patience, lambda at, status: status == Status.IDLE and near(at, goal), f"has not reached {place}")


def near(at: Position | None, goal: Position) -> bool:
    """Whether a measured position is the goal, as exactly as the rig moves; a heading may have another turn's name."""
    if at is None or math.dist((at.x, at.y), (goal.x, goal.y)) >= NEAR:
        return False
    return abs(math.remainder(at.yaw - goal.yaw, math.tau)) < NEAR_YAW


def _wait(
    link: Link,
    patience: float,
    done: Callable[[Position | None, Status | None], bool],
    what: str,
    request: bytes = REQUEST_STATE,
) -> None:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        at, status, *_ = link.exchange(request, ANSWER)
        if done(at, status):
            return
        if status in SENTENCES:
            raise RigError(trouble(link, status))
        time.sleep(POLL)
    raise RigError(f"the rig at {link.name} {what} after {patience:g} s")
