"""Manual control of the rig: ``python -m services.gantry.manual --serial=PORT ACTION``, which prints one JSON object.

Where standard input is a pipe, its end stops the rig, too: the command that moved it has died.
Actions: ``status``, ``home``, ``goto X Y YAW`` (m, m, degrees), ``calibrate`` and ``check``. The rig is stopped
at every exit, unless a fault has stopped it: that is kept to be seen, and ``calibrate`` acknowledges it. Exit codes:
0 done, 1 the rig cannot (``error`` says why; of ``check``, ``reason`` says why it is not fit), 2 usage.
"""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.opendlv.numbers import number
from services.base import Flags
from services.base.flags import parse
from services.base.manifest import load_manifest
from services.base.signals import interruptible, stop_without_master
from services.gantry import health_check, memory, start
from services.gantry.conversion import BUILT_IN, Conversion
from services.gantry.emulator import EmulatedRig
from services.gantry.link import Link, RigError
from services.gantry.motion import MotionLimits
from services.gantry.port import SerialPort, checked
from services.gantry.protocol import Position, Status
from services.gantry.rig_limits import conversion_of, is_circle, kept_limits, true_box
from services.gantry.service import EMULATED, describe, place

ACTIONS = {"status": 0, "home": 0, "goto": 3, "calibrate": 0, "check": 0}
"""How many numbers each takes."""
FLAGS = (
    "serial",
    "kind",
    "patience",
    "limits",
    "range-x",
    "range-y",
    "range-yaw",
    *(f"{what}-{axis}" for what in ("steps", "offset") for axis in BUILT_IN),
)
DONE, BROKEN, USAGE = 0, 1, 2


class ManualUsageError(ValueError):
    """A wrong command line, or a place out of the rig's ranges; one sentence."""


def main(argv: Sequence[str], stdout: TextIO) -> int:
    """Do one action and print its result."""
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
    about = load_manifest(Path(__file__).parent)["parameters"]
    manifest = {"name": "gantry", "parameters": {name: about[name] for name in FLAGS}}
    words = [word for word in argv if not word.startswith("--")]
    try:
        flags = parse(manifest, [*(word for word in argv if word.startswith("--")), "--cid=1"])
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
        return health_check.home(limits, conversion)
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
        emulated = resources.enter_context(EmulatedRig(kind=flags["kind"])) if flags["serial"] == EMULATED else None
        target = checked(emulated.port if emulated else flags["serial"])
        link = Link(target, lambda: SerialPort(target), conversion=conversion_of(flags))
        resources.callback(link.close)
        if action == "check":
            health = health_check.run_checks(link, limits, kept, patience)
            return {**health, **(_where(link, limits) if health["ok"] else {})}, DONE if health["ok"] else BROKEN
        status = start.find(link)
        start.check_kind(link, is_circle(flags))
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
    at, status = health_check.read_state(link)
    return {
        "status": int(status),
        "word": status.name.lower().replace("_", " "),
        "says": describe(status),
        "x": at.x if at else None,
        "y": at.y if at else None,
        "yaw": math.degrees(at.yaw) if at else None,
        "limits": memory.shown(memory.read(link), link.conversion),
        "reach": {
            "x": [limits.low.x, limits.high.x],
            "y": [limits.low.y, limits.high.y],
            "yaw": None if link.conversion.circle else [math.degrees(end.yaw) for end in (limits.low, limits.high)],
        },
        "steps": {axis: round(count, 4) for axis, count in link.conversion.steps(at).items()} if at else None,
    }


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], sys.stdout))
