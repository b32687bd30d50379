"""Manual control of the rig: ``python -m services.gantry.manual --serial=PORT ACTION``, which prints one JSON object.

Actions: ``status``, ``home``, ``goto X Y YAW`` (m, m, degrees), ``calibrate`` and ``check``. The rig is stopped at
every exit, also at the end of a pipe as standard input, unless a fault has stopped it: ``calibrate`` acknowledges that.
Exit codes: 0 done, 1 the rig cannot (``error`` says why; of ``check``, ``reason`` says why it is not fit), 2 usage.
"""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.opendlv.numbers import number
from services.base import Flags
from services.base.flags import load_manifest, parse
from services.base.process import interruptible, stop_without_master
from services.gantry import memory, start
from services.gantry.link import REQUEST_STATE, Link, RigError
from services.gantry.memory import conversion_of, kept_limits, true_box
from services.gantry.motion import Conversion, MotionLimits
from services.gantry.protocol import Position
from services.gantry.rig_table import Status
from services.gantry.service import describe, opened, place

ROUNDS = 20
ANSWER = 0.25
"""s within which position and status have to come, each time."""
DECIMAL = 1e-4
INDEX = -math.pi
"""rad, the heading at the index of a yaw that turns without end, by its firmware."""


def find_home(limits: MotionLimits, conversion: Conversion) -> Position:
    """The true place at the switches, as far as the limits reach, that the line's decimals do not round outside."""
    index = conversion.to_true(Position(0.0, 0.0, INDEX)).yaw
    return replace(limits.low, yaw=index if math.isinf(limits.low.yaw) else limits.low.yaw + DECIMAL)


def read_state(link: Link) -> tuple[Position | None, Status]:
    """Position and status; a rig that is not calibrated has no position. Raises RigError when no answer comes."""
    for _ in range(ROUNDS):
        at, status, refusals, *_ = link.exchange(REQUEST_STATE, ANSWER)
        if status is not None and (at is not None or refusals):
            return at, status
    raise RigError(f"the rig at {link.name} does not report its position")


def run_checks(link: Link, kept: Mapping[str, float], patience: float) -> None:
    """Finds home, and writes the limits ``kept``; raises RigError, why the rig is unfit."""
    start.settle(link, start.find(link))
    memory.agree(link, kept, write=True)
    start.calibrate(link, patience)


ACTIONS = {"status": 0, "home": 0, "goto": 3, "calibrate": 0, "check": 0}
DONE, BROKEN, USAGE = 0, 1, 2


class ManualUsageError(ValueError):
    """A wrong command line, or a place out of the rig's ranges; one sentence."""


def main(argv: Sequence[str], stdout: TextIO) -> int:
    try:
        flags, action, numbers = _parsed(argv)
        limits, kept = _limits(flags), kept_limits(flags)
        goal = _goal(action, numbers, limits, conversion_of(flags))
        result, code = _done(flags, action, goal, limits, kept)
    except RigError as error:
        result, code = {"error": str(error)}, BROKEN
    except ManualUsageError as error:
        result, code = {"error": str(error)}, USAGE
    except (ValueError, OSError) as error:
        result, code = {"error": " ".join(str(error).split())}, BROKEN
    stdout.write(json.dumps(result) + "\n")
    stdout.flush()
    return code


def _parsed(argv: Sequence[str]) -> tuple[Flags, str, list[float]]:
    words = [word for word in argv if not word.startswith("--")]
    try:
        given = ["--cid=1", *(word for word in argv if word.startswith("--"))]
        flags = parse(load_manifest(Path(__file__).parent), given)
        action, numbers = words[0] if words else "", [number(word) for word in words[1:]]
    except ValueError as error:
        raise ManualUsageError(str(error)) from None
    if action not in ACTIONS:
        raise ManualUsageError(f"'{action}' is not an action, expected one of {', '.join(ACTIONS)}")
    if len(numbers) != ACTIONS[action] or not all(map(math.isfinite, numbers)):
        raise ManualUsageError(f"{action} takes {ACTIONS[action] or 'no'} numbers: X and Y in m, YAW in degrees")
    return flags, action, numbers


def _limits(flags: Flags) -> MotionLimits:
    low, high = true_box(flags)
    return MotionLimits(low=low, high=high)


def _goal(action: str, numbers: Sequence[float], limits: MotionLimits, conversion: Conversion) -> Position | None:
    """Where an action leads; raises UsageError for a place out of the rig's ranges, before anything moves."""
    if action == "home":
        return find_home(limits, conversion)
    if action != "goto":
        return None
    yaw = math.radians(numbers[2])
    goal = Position(numbers[0], numbers[1], yaw if math.isfinite(limits.high.yaw) else math.remainder(yaw, math.tau))
    if not limits.holds(goal):
        low, high = limits.low, limits.high
        ranges = f"x {low.x:g} to {high.x:g} m, y {low.y:g} to {high.y:g} m"
        turn = (
            "any yaw"
            if math.isinf(low.yaw)
            else f"yaw {math.degrees(low.yaw):.1f} to {math.degrees(high.yaw):.1f} degrees"
        )
        raise ManualUsageError(f"the place is out of the rig's ranges ({ranges}, {turn}): {place(goal)}")
    return goal


def _done(
    flags: Flags, action: str, goal: Position | None, limits: MotionLimits, kept: Mapping[str, float]
) -> tuple[dict[str, Any], int]:
    patience = flags["patience"]
    with ExitStack() as resources, interruptible():
        stop_without_master()
        link, emulated = opened(flags, resources)
        if action == "check":
            try:
                run_checks(link, kept, patience)
            except RigError as error:
                return {"ok": False, "reason": str(error)}, BROKEN
            return {"ok": True, **_where(link, limits)}, DONE
        status = start.find(link)
        calibrates = action == "calibrate" or bool(emulated and goal)
        if action != "status":
            memory.agree(link, kept, write=calibrates, widen=action == "calibrate")
        if calibrates:
            start.calibrate(link, patience)
        elif goal and status == Status.NOT_CALIBRATED:
            raise RigError(start.trouble(link, status))
        if goal:
            start.settle(link, status)
            start.go(link, goal, patience)
        return _where(link, limits), DONE


def _where(link: Link, limits: MotionLimits) -> dict[str, Any]:
    """Status, true limits and places within reach; after homing the true place, and the counters' full steps.

    Yaw is in degrees but in ``limits``, which are those that the rig's memory has.
    """
    at, status = read_state(link)
    return {
        "status": int(status),
        "word": status.name.lower().replace("_", " "),
        "says": describe(status),
        "x": at.x if at else None,
        "y": at.y if at else None,
        "yaw": math.degrees(at.yaw) if at else None,
        "limits": memory.shown(memory.read_memory(link), link.conversion),
        "reach": {
            "x": [limits.low.x, limits.high.x],
            "y": [limits.low.y, limits.high.y],
            "yaw": None if link.conversion.circle else [math.degrees(end.yaw) for end in (limits.low, limits.high)],
        },
        "steps": {axis: round(count, 4) for axis, count in link.conversion.steps(at).items()} if at else None,
    }


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
