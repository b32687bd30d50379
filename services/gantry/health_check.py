"""Whether a rig is fit for a test: its line answers reliably and in time, and its home has not moved."""

import math
import statistics
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from services.gantry import memory, start
from services.gantry.conversion import Conversion
from services.gantry.link import REQUEST_STATE, Link, RigError
from services.gantry.motion import MotionLimits
from services.gantry.protocol import Position, Status, Word

ROUNDS = 20
ANSWER = 0.25
"""s within which position and status have to come, each time."""
LATENCY = 0.05
"""s that the median answer may take; the firmware needs 5 ms and the line as much."""
DISTANCES = {"x": 0.04, "y": 0.04, "yaw": 0.15}
"""How far from home (m, m, rad) each axis looks for home, and from twice as far."""
CIRCLE_DISTANCES = {"x": 0.08, "y": 0.08, "yaw": math.radians(14.4)}
"""The same where the yaw turns without end: farther, as from index to index it takes longer than the others at home.
Motors jump to a pole first; eight full steps are the same between poles."""
SPEEDS = {"x": 0.1, "y": 0.1, "yaw": 0.35}
"""Of homing (m/s, m/s, rad/s), as firmware/protocol.yml has them."""
REPEATS = {"x": 0.005, "y": 0.005, "yaw": math.radians(2.5)}
"""By how much the switch may have moved (m, m, rad)."""
DECIMAL = 1e-4
INDEX = -math.pi
"""rad, the heading at the index of a yaw that turns without end, by its firmware."""
TRIES = 3
"""For each axis, as a busy machine sometimes measures late."""
BESIDE = 0.5
"""rad beside the index, from where a turn begins and ends."""
_POLL = 0.005

Check = dict[str, Any]


def home(limits: MotionLimits, conversion: Conversion) -> Position:
    """The true place at the switches, as far as the limits reach, that the line's decimals do not round outside."""
    return replace(limits.low, yaw=_index(conversion) if _endless(limits) else limits.low.yaw + DECIMAL)


def _index(conversion: Conversion) -> float:
    return conversion.to_true(Position(0.0, 0.0, INDEX)).yaw


def _endless(limits: MotionLimits) -> bool:
    return math.isinf(limits.low.yaw)


def read_state(link: Link) -> tuple[Position | None, Status]:
    """Position and status; a rig that is not calibrated has no position. Raises RigError when no answer comes."""
    for _ in range(ROUNDS):
        at, status, refusals, *_ = link.exchange(REQUEST_STATE, ANSWER)
        if status is not None and (at is not None or refusals):
            return at, status
    raise RigError(f"the rig at {link.name} does not report its position")


def run_checks(link: Link, limits: MotionLimits, kept: Mapping[str, float], patience: float) -> dict[str, Any]:
    """``ok``, the ``reason`` when it is not, and the ``checks``; the rig moves, and ends at home.

    A rig that cannot move, or still reports an old fault, is not fit. Its memory gets the limits ``kept``.
    """
    checks: list[Check] = []
    try:
        status = start.find(link)
        start.check_kind(link, _endless(limits))
        start.settle(link, status)
        memory.agree(link, kept, write=True)
        start.calibrate(link, patience)
        checks += _answers(link)
        if all(check["ok"] for check in checks):
            checks += _homing(link, limits, patience)
            if _endless(limits):
                _turn_around(link, limits, patience)
    except RigError as error:
        return {"ok": False, "reason": str(error), "checks": checks}
    bad = [check for check in checks if not check["ok"]]
    return {"ok": not bad, "reason": _reason(bad[0]) if bad else "", "checks": checks}


def _reason(check: Check) -> str:
    (kind, bound), *_ = check["limit"].items()
    than = "at most" if kind == "max" else "at least"
    return f"{check['name']} is {check['value']:g} {check['unit']}, expected {than} {bound:g}".replace("  ", " ")


def _check(name: str, value: float, unit: str, **limit: float) -> Check:
    ok = limit.get("min", -math.inf) <= value <= limit.get("max", math.inf)
    return {"name": name, "value": round(value, 3), "limit": limit, "unit": unit, "ok": ok}


def _answers(link: Link) -> list[Check]:
    took = []
    for _ in range(ROUNDS):
        begin = time.monotonic()
        at, status, *_ = link.exchange(REQUEST_STATE, ANSWER)
        if at is not None and status is not None:
            took.append(time.monotonic() - begin)
    middle = statistics.median(took) if took else ANSWER
    return [
        _check("answers", len(took), f"of {ROUNDS}", min=ROUNDS),
        _check("latency", 1000 * middle, "ms", max=1000 * LATENCY),
    ]


def _homing(link: Link, limits: MotionLimits, patience: float) -> list[Check]:
    """Homes from two places of each axis: the times differ by the distance between them, unless home has moved.

    Positions mean nothing while homing, and agree with themselves afterwards whatever steps were lost.
    """
    checks = []
    for axis, unit in (("x", "mm"), ("y", "mm"), ("yaw", "deg")):
        scale = math.degrees(1) if unit == "deg" else 1000
        off = math.inf
        for _ in range(TRIES):
            if off > REPEATS[axis]:
                off = min(off, _difference(link, limits, axis, patience))
        checks.append(_check(f"homing {axis}", scale * off, unit, max=scale * REPEATS[axis]))
    return checks


def _turn_around(link: Link, limits: MotionLimits, patience: float) -> None:
    """Turn once around, past the index, and back past it: the firmware notices where it is not. Raises RigError."""
    at = home(limits, link.conversion)
    ways = (1, Word.GOTO), (-1, Word.GOTOLEFT), (1, Word.GOTOLEFT), (-1, Word.GOTORIGHT)
    for side, word in ways:
        start.go(link, replace(at, yaw=at.yaw + side * BESIDE), patience, word)


def _difference(link: Link, limits: MotionLimits, axis: str, patience: float) -> float:
    """By how much an axis' switch seems to have moved the second time (m or rad)."""
    low: float = _index(link.conversion) if axis == "yaw" and _endless(limits) else getattr(limits.low, axis)
    high: float = getattr(limits.high, axis)
    distance = min((CIRCLE_DISTANCES if _endless(limits) else DISTANCES)[axis], (high - low) / 2)
    took = []
    for times in (1, 2):
        start.go(link, replace(home(limits, link.conversion), **{axis: low + times * distance}), patience)
        took.append(start.calibrate(link, patience, _POLL))
    return abs((took[1] - took[0]) * SPEEDS[axis] * link.conversion.scale[axis] - distance)
