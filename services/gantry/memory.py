"""A rig's limits by the gantry's flags: true ones for what moves it, and its firmware's in the rig's memory."""

import logging
import math
import time
from collections.abc import Mapping
from typing import Any

from services.base import Flags
from services.gantry import start
from services.gantry.link import Link, PortError, RigError
from services.gantry.motion import (
    BUILT_IN,
    BUILT_IN_CIRCLE,
    FARTHEST_OFFSET,
    AxisConstants,
    Conversion,
    MotionLimits,
    box,
)
from services.gantry.protocol import Limits, Position, Word, command
from services.gantry.rig_table import CIRCLE_YAW, LIMITS, Source, Status

UNITS = {
    "x": "m",
    "y": "m",
    "yaw": "rad",
    "speed": "m/s",
    "yaw-rate": "rad/s",
    "acceleration": "m/s2",
    "yaw-acceleration": "rad/s2",
}
_WRITING = 3.0
"""s that the rig may take to stand still, and again to write; it needs 0.25 s for that."""
_NEAR = 2e-6
_DECIMALS, _EXACT = 4, 1e-6
"""A limit is rounded down to so many decimals; what is only a floating-point number's error below one is it."""

_log = logging.getLogger(__name__)


def wanted(text: str | None, conversion: Conversion) -> dict[str, float]:
    """The memory's limits by name for true ones such as ``x=1.5,speed=0.4``; others are the widest.

    They are its firmware's, by which no place, speed or acceleration is beyond the true limit, but where that is
    narrower than the memory can have: then it has the narrowest, and the programs that move the rig keep the true one.
    Raises PortError for a text that is not such a list.
    """
    circle = conversion.circle
    found = {name: widest for name, (_, widest) in LIMITS.items()} | ({"yaw": CIRCLE_YAW} if circle else {})
    for word in filter(None, (text or "").split(",")):
        name, _, number = word.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if name not in found or not value > 0 or (circle and name == "yaw"):
            raise PortError(f"'{word}' is not a limit, expected for example speed=0.4")
        narrowest, widest = LIMITS[name]
        value, scale = conversion.limit_to_firmware(name, value), 10**_DECIMALS
        found[name] = widest if value >= widest else max(narrowest, math.floor(value * scale + _EXACT) / scale)
    return found


def agree(link: Link, limits: Mapping[str, float], write: bool, widen: bool = False) -> None:
    """See that the rig's memory has these limits of its firmware; with ``write`` they are written if it has others.

    Limits that were kept become wider with ``widen`` alone, as an operator asks for it: what is safe on a rig is not up
    to each repository with a test for it. Raises PortError then, and RigError if the memory has other limits at last.
    """
    found = read_memory(link)
    if _is(found, limits):
        return
    rig = f"the memory of the rig at {link.name} {_deviation(found, limits, link.conversion)}"
    if not write:
        raise RigError(f"{rig}; calibrate it, which writes them")
    wider = any(limit > kept + _NEAR for limit, kept in zip(limits.values(), found.values, strict=True))
    if found.source == Source.KEPT and wider and not widen:
        raise PortError(f"{rig}; only 'dodo rig calibrate' makes them wider")
    _forget(link)
    numbers = ",".join(f"{value:.6f}".rstrip("0").rstrip(".") for value in limits.values())
    answers = link.exchange(f"${Word.SETLIMITS}:{numbers}\n".encode("ascii") + command(Word.STATUS), start.ANSWER)
    if answers.refusals:
        raise RigError(f"the rig at {link.name} refuses its limits: {answers.refusals[0]}")
    end = time.monotonic() + _WRITING
    while (found := read_memory(link)).source == Source.WRITING and time.monotonic() < end:
        time.sleep(start.POLL)
    if not _is(found, limits):
        what = _deviation(found, limits, link.conversion)
        raise RigError(f"the memory of the rig at {link.name} {what}, although it was written")
    _log.info("the rig at %s keeps its limits: %s", link.name, _text(limits, link.conversion))


def read_memory(link: Link) -> Limits:
    """The memory's limits. Raises RigError, also for the firmware of the other kind of rig, before anything moves.

    Only the yaw of a circle has the limit of a whole turn: its firmware would wind up the cable of another rig.
    """
    rig = f"the firmware of the rig at {link.name}"
    for _ in range(start.TRIES):
        found = link.exchange(command(Word.LIMITS) + command(Word.STATUS), start.ANSWER).limits
        if found is None:
            continue
        circle = dict(zip(LIMITS, found.values, strict=True))["yaw"] > LIMITS["yaw"][1] + _NEAR
        if circle and not link.conversion.circle:
            raise RigError(f"{rig} is that of the kind circle: flash gantry.elf, or name the kind")
        if link.conversion.circle and not circle:
            raise RigError(f"{rig} is not that of the kind circle: flash gantry-circle.elf")
        return found
    raise RigError(f"{rig} does not say its limits")


def shown(found: Limits, conversion: Conversion) -> dict[str, Any]:
    """True limits for people and programs: by name, and where they are ``from``."""
    return {**_true(dict(zip(LIMITS, found.values, strict=True)), conversion), "from": found.source.name.lower()}


def _forget(link: Link) -> None:
    """Stop the rig, and make it forget its home as soon as it stands. Raises RigError."""
    start.give(link, Word.STOP)
    end = time.monotonic() + _WRITING
    while True:
        answers = link.exchange(command(Word.FORGET) + command(Word.STATUS), start.ANSWER)
        if not answers.refusals and answers.status is not None:
            break
        if time.monotonic() > end:
            reason = answers.refusals[0] if answers.refusals else "it does not answer"
            raise RigError(f"the rig at {link.name} cannot be given its limits: {reason}")
        time.sleep(start.POLL)
    if answers.status != Status.NOT_CALIBRATED:
        raise RigError(f"the rig at {link.name} cannot be given its limits: it still knows its home")


def _is(found: Limits, limits: Mapping[str, float]) -> bool:
    near = all(abs(a - b) < _NEAR for a, b in zip(found.values, limits.values(), strict=True))
    return near and found.source in (Source.BUILT, Source.KEPT)


def _deviation(found: Limits, limits: Mapping[str, float], conversion: Conversion) -> str:
    if found.source == Source.DAMAGED:
        return "is damaged, and the narrowest limits hold instead of those of its file"
    others = dict(zip(LIMITS, found.values, strict=True))
    has, expected = (_text(_differences(*two), conversion) for two in ((others, limits), (limits, others)))
    return f"has other limits than its file: {has}, expected {expected}"


def _differences(limits: Mapping[str, float], others: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in limits.items() if abs(value - others[name]) >= _NEAR}


def _true(limits: Mapping[str, float], conversion: Conversion) -> dict[str, float]:
    return {name: round(conversion.limit_to_true(name, value), 6) for name, value in limits.items()}


def _text(limits: Mapping[str, float], conversion: Conversion) -> str:
    return ", ".join(f"{name} {value:g} {UNITS[name]}" for name, value in _true(limits, conversion).items())


CIRCLE = "circle"


def is_circle(flags: Flags) -> bool:
    """Whether the rig's yaw turns without end; raises PortError for a kind that there is not."""
    if flags["kind"] not in (None, CIRCLE):
        raise PortError(f"'{flags['kind']}' is not a kind of rig, expected {CIRCLE}, or none")
    return bool(flags["kind"] == CIRCLE)


def conversion_of(flags: Flags) -> Conversion:
    """With the constants that were measured on the rig; raises PortError for those that it cannot have."""
    circle = is_circle(flags)
    built = BUILT_IN_CIRCLE if circle else BUILT_IN
    measured = {}
    for axis, built_in in built.items():
        steps, offset = flags[f"steps-{axis}"], flags[f"offset-{axis}"]
        steps = steps * math.degrees(1) if steps is not None and axis == "yaw" else steps
        if axis == "yaw" and circle and steps is not None:
            raise PortError("the yaw of a circle has no steps to measure: its turn has 200; only its offset differs")
        if axis == "yaw" and offset is not None and abs(offset - built_in.offset) > FARTHEST_OFFSET:
            low, high = built_in.offset - FARTHEST_OFFSET, built_in.offset + FARTHEST_OFFSET
            raise PortError(f"offset-yaw is {offset:g} steps, expected {low:g} to {high:g} on this kind of rig")
        measured[axis] = AxisConstants(
            built_in.steps if steps is None else steps, built_in.offset if offset is None else offset
        )
    return Conversion(measured, circle)


def kept_limits(flags: Flags) -> dict[str, float]:
    """The limits that the rig's memory has to have, by name, in its firmware's frame."""
    return wanted(flags["limits"], conversion_of(flags))


def true_box(flags: Flags) -> tuple[Position, Position]:
    """The lowest and the highest true place of the rig."""
    ranges = flags["range-x"], flags["range-y"], math.radians(flags["range-yaw"])
    return box(*ranges, conversion_of(flags), kept_limits(flags))


def motion_limits(flags: Flags) -> MotionLimits:
    """The rig's true limits, or tighter ones; never more than its memory has on any axis."""
    kept, scale = kept_limits(flags), conversion_of(flags).scale
    least = min(scale["x"], scale["y"])
    low, high = true_box(flags)
    return MotionLimits(
        speed=min(flags["max-speed"], kept["speed"] * least),
        acceleration=min(flags["max-acceleration"], kept["acceleration"] * least),
        yaw_rate=min(flags["max-yaw-rate"], kept["yaw-rate"] * scale["yaw"]),
        yaw_acceleration=min(flags["max-yaw-acceleration"], kept["yaw-acceleration"] * scale["yaw"]),
        low=low,
        high=high,
    )
