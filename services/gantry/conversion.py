"""Between true places and those of the firmware, whose conversion to steps (Table 4.2) is built in.

A place is y = c x + offset full steps from home. Where c and offset were measured on a rig, commands carry the place
that the firmware converts to the same steps. So there are two frames: true places, of specs, kinematic states, frames
and limits of ``dodo.yml``; and the firmware's, of the line and of the limits in the rig's memory.
"""

import math
from dataclasses import dataclass

from services.gantry.protocol import Position
from services.gantry.rig_table import CIRCLE_OFFSET, CIRCLE_STEPS, OFFSETS, STEPS

FARTHEST_OFFSET = 11
"""Full steps by which the measured offset of a yaw may differ from the built-in one."""


@dataclass(frozen=True)
class AxisConstants:
    """``steps``: full steps per m, or per rad of the yaw; ``offset``: full steps from home to 0."""

    steps: float
    offset: float


BUILT_IN = {
    axis: AxisConstants(STEPS[axis] * (math.degrees(1) if axis == "yaw" else 1.0), OFFSETS[axis]) for axis in STEPS
}
"""What the firmware converts with."""
BUILT_IN_CIRCLE = {**BUILT_IN, "yaw": AxisConstants(CIRCLE_STEPS / math.tau, CIRCLE_OFFSET)}
"""The same where the yaw turns without end."""


class Conversion:
    """Converts with constants of some axes that were measured, and with the firmware's for the others."""

    def __init__(self, measured: dict[str, AxisConstants] | None = None, circle: bool = False) -> None:
        """``circle``: the yaw turns without end; its steps per rad cannot differ, as a turn is a turn."""
        self.circle = circle
        self._built_in = BUILT_IN_CIRCLE if circle else BUILT_IN
        self._constants = {**self._built_in, **(measured or {})}
        self.scale = {axis: self._built_in[axis].steps / one.steps for axis, one in self._constants.items()}
        """Of each axis: how many true m (rad) one m (rad) of the firmware is."""

    def to_firmware(self, place: Position) -> Position:
        """A true place in the firmware's frame, as commands carry it."""
        values = (self._in_firmware(axis, getattr(place, axis)) for axis in BUILT_IN)
        return self._named(Position(*values))

    def to_true(self, reported: Position) -> Position:
        """The true place of one that the firmware reports."""
        true = (self._true(axis, getattr(reported, axis)) for axis in BUILT_IN)
        return self._named(Position(*true))

    def velocity(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """A true velocity in the firmware's frame (m/s, m/s, rad/s)."""
        return x / self.scale["x"], y / self.scale["y"], yaw / self.scale["yaw"]

    def limit_to_firmware(self, name: str, limit: float) -> float:
        """The largest limit of the firmware by which the rig keeps a true one, of the rig's memory's names."""
        return (limit - self._shift(name)) / self._largest(name)

    def limit_to_true(self, name: str, limit: float) -> float:
        """The true limit that the rig keeps by one of its firmware."""
        return limit * self._largest(name) + self._shift(name)

    def steps(self, place: Position) -> dict[str, float]:
        """The counters at a true place, in full steps from home."""
        return {axis: one.steps * getattr(place, axis) + one.offset for axis, one in self._constants.items()}

    def _shift(self, name: str) -> float:
        """The yaw's limit is to either side of true 0, the firmware's of its own."""
        return abs(self._true("yaw", 0.0)) if name == "yaw" and not self.circle else 0.0

    def _largest(self, name: str) -> float:
        if name in ("speed", "acceleration"):
            return max(self.scale["x"], self.scale["y"])
        return self.scale["yaw" if name.startswith("yaw") else name]

    def _named(self, place: Position) -> Position:
        return Position(place.x, place.y, math.remainder(place.yaw, math.tau)) if self.circle else place

    def _in_firmware(self, axis: str, value: float) -> float:
        measured, built_in = self._constants[axis], self._built_in[axis]
        return value / self.scale[axis] + (measured.offset - built_in.offset) / built_in.steps

    def _true(self, axis: str, value: float) -> float:
        measured, built_in = self._constants[axis], self._built_in[axis]
        return value * self.scale[axis] + (built_in.offset - measured.offset) / measured.steps
