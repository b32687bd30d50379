"""The limits of a rig by the gantry's flags: true ones for what moves it, and its firmware's for the rig's memory."""

import math

from services.base import Flags
from services.gantry import memory
from services.gantry.conversion import (
    BUILT_IN,
    BUILT_IN_CIRCLE,
    FARTHEST_OFFSET,
    AxisConstants,
    Conversion,
)
from services.gantry.motion import MotionLimits, box
from services.gantry.port import PortError
from services.gantry.protocol import Position

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
    return memory.wanted(flags["limits"], conversion_of(flags))


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
