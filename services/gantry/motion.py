"""Velocities of the vehicle's body as the rig can follow them, and places as its firmware converts them.

Velocities are turned into the rig's frame and kept within its limits. The rig's frame: x forward, y to the left, 0 in
the middle, heading counter-clockwise from forward. The camera stands for the vehicle's centre of mass.

The firmware's conversion to steps (Table 4.2) is built in: a place is y = c x + offset full steps from home. Where c
and offset were measured on a rig, commands carry the place that the firmware converts to the same steps. So there are
two frames: true places, of specs, kinematic states, frames and limits of ``dodo.yml``; and the firmware's, of the line
and of the limits in the rig's memory.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from services.gantry.protocol import Position
from services.gantry.rig_table import BOUNDS, CIRCLE_OFFSET, CIRCLE_STEPS, LIMITS, OFFSETS, STEPS

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
BUILT_IN_CIRCLE = {**BUILT_IN, "yaw": AxisConstants(CIRCLE_STEPS / math.tau, CIRCLE_OFFSET)}


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
        """The yaw's limit is to either side of true 0, the firmware's of its own 0."""
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


HOME = Position(*(BOUNDS[axis][0] for axis in ("x", "y", "yaw")))
"""Where the limit switches are, rounded to the inside: step 0 of Table 4.2's conversions."""
FARTHEST = Position(*(BOUNDS[axis][1] for axis in ("x", "y", "yaw")))
"""The other end of the workspace of 1.9 m by 1.4 m, and of the turn; both are as long to the other side of 0."""
LATENCY = 0.1
"""s from a measurement to the motion decided upon it, plus four steps, with which braking that comes a step late does
not swing over the edge."""


@dataclass(frozen=True)
class Velocity:
    """m/s along x and y, rad/s about z: of the body or in the rig's frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True)
class MotionLimits:
    """m/s, m/s2, rad/s, rad/s2, and the box of positions (m, rad)."""

    speed: float = 1.0
    acceleration: float = 0.5
    yaw_rate: float = 1.0
    yaw_acceleration: float = 1.0
    low: Position = HOME
    high: Position = FARTHEST

    def holds(self, position: Position) -> bool:
        inside = self.low.x <= position.x <= self.high.x and self.low.y <= position.y <= self.high.y
        return inside and self.low.yaw <= position.yaw <= self.high.yaw


def box(
    range_x: float,
    range_y: float,
    range_yaw: float,
    conversion: Conversion | None = None,
    kept: Mapping[str, float] | None = None,
) -> tuple[Position, Position]:
    """The true positions within so many m from home and rad to either side, as far as rig and firmware go.

    ``kept`` are the limits in the rig's memory. A yaw that turns without end has no bounds.
    """
    conversion, kept = conversion or Conversion(), kept or {name: widest for name, (_, widest) in LIMITS.items()}
    home = conversion.to_true(replace(HOME, yaw=max(HOME.yaw, -kept["yaw"])))
    end = conversion.to_true(Position(HOME.x + kept["x"], HOME.y + kept["y"], min(FARTHEST.yaw, kept["yaw"])))
    high_x, high_y = min(FARTHEST.x, end.x, home.x + range_x), min(FARTHEST.y, end.y, home.y + range_y)
    low_x, low_y = min(high_x, max(-FARTHEST.x, home.x)), min(high_y, max(-FARTHEST.y, home.y))
    low_yaw, high_yaw = max(-FARTHEST.yaw, home.yaw, -range_yaw), min(FARTHEST.yaw, end.yaw, range_yaw)
    if conversion.circle:
        low_yaw, high_yaw = -math.inf, math.inf
    return Position(low_x, low_y, low_yaw), Position(high_x, high_y, high_yaw)


def turned(velocity: Velocity, yaw: float) -> Velocity:
    """A body's velocity in the frame in which the body is turned by ``yaw`` (rad)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return Velocity(c * velocity.x - s * velocity.y, s * velocity.x + c * velocity.y, velocity.yaw)


class Shaper:
    """Turns the vehicle's velocities into commands for the rig, step by step."""

    def __init__(self, limits: MotionLimits) -> None:
        self.limits = limits
        self.velocity = Velocity()
        self.cut = 0
        """Steps in which the edge of the workspace took speed away."""

    def step(self, body: Velocity, at: Position, dt: float) -> Velocity:
        """The velocity in the rig's frame for the next ``dt`` seconds, from the body's and the measured position.

        A speed above the limit is cut without a change of direction; it changes no faster than the accelerations;
        towards an edge it is never higher than the rig can brake from.
        """
        limits = self.limits
        wanted = turned(body, at.yaw)
        x, y = _shortened(wanted.x, wanted.y, limits.speed)
        change_x, change_y = _shortened(x - self.velocity.x, y - self.velocity.y, limits.acceleration * dt)
        rate = _within(wanted.yaw, limits.yaw_rate)
        rate = self.velocity.yaw + _within(rate - self.velocity.yaw, limits.yaw_acceleration * dt)
        free = Velocity(self.velocity.x + change_x, self.velocity.y + change_y, rate)
        self.velocity = self._before_the_edge(free, at, LATENCY + 4 * dt)
        self.cut += self.velocity != free
        return self.velocity

    def halt(self) -> None:
        self.velocity = Velocity()

    def _before_the_edge(self, v: Velocity, at: Position, lag: float) -> Velocity:
        low, high, limits = self.limits.low, self.limits.high, self.limits
        return Velocity(
            _edged(v.x, at.x - low.x, high.x - at.x, limits.acceleration, lag),
            _edged(v.y, at.y - low.y, high.y - at.y, limits.acceleration, lag),
            _edged(v.yaw, at.yaw - low.yaw, high.yaw - at.yaw, limits.yaw_acceleration, lag),
        )


def _within(value: float, bound: float) -> float:
    return max(-bound, min(bound, value))


def _shortened(x: float, y: float, longest: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return (x, y) if length <= longest else (x * longest / length, y * longest / length)


def _edged(v: float, below: float, above: float, acceleration: float, lag: float) -> float:
    return max(-_braking_speed(below, acceleration, lag), min(_braking_speed(above, acceleration, lag), v))


def _braking_speed(room: float, acceleration: float, lag: float) -> float:
    """The speed from which the rig stops within ``room`` after ``lag`` s: v lag + v^2 / 2a = room."""
    if room <= 0:
        return 0.0
    lost = acceleration * lag
    return math.sqrt(lost * lost + 2 * acceleration * room) - lost
