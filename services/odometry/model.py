"""Dead reckoning: the pose since the start that a vehicle's wheels and gyroscope add up, with their errors."""

import math
import random
from typing import NamedTuple


class Twist(NamedTuple):
    """Velocities of the body: x forward and y to the left in m/s, turning to the left in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0


class Pose(NamedTuple):
    """In m and rad, from where and how the body stood at the start; the yaw counts whole turns, too."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def moved(self, twist: Twist, dt: float) -> "Pose":
        """After ``dt`` seconds of a constant twist: exactly, on the arc."""
        half = twist.yaw_rate * dt / 2
        chord = dt * (math.sin(half) / half if half else 1.0)
        c, s = chord * math.cos(self.yaw + half), chord * math.sin(self.yaw + half)
        return Pose(self.x + c * twist.vx - s * twist.vy, self.y + s * twist.vx + c * twist.vy, self.yaw + 2 * half)


class Errors(NamedTuple):
    """What is wrong with what is read: all 0 for odometry without drift.

    ``scale`` is the share by which speeds are too large; the others are in m/s, rad/m and rad/s. Noise has a standard
    deviation, for each twist while the body moves, and what is read as turning is positive to the left.
    """

    scale: float = 0.0
    speed_noise: float = 0.0
    yaw_per_metre: float = 0.0
    yaw_bias: float = 0.0
    yaw_noise: float = 0.0


class Odometer:
    """Adds up the twists that it reads, each held until the next; ``pose`` is None before the first."""

    def __init__(self, errors: Errors, seed: int = 0) -> None:
        self.pose: Pose | None = None
        self.twist, self._last = Twist(), 0
        self._errors, self._random = errors, random.Random(seed)  # noqa: S311

    def feed(self, true: Twist, sample_time: int) -> None:
        """Take the body's twist at a time in us."""
        if self.pose is None:
            self.pose, self._last = Pose(), sample_time
        self.update(sample_time)
        errors, scale = self._errors, 1 + self._errors.scale
        speed, turn = (self._random.gauss(0.0, n) if any(true) else 0.0 for n in (errors.speed_noise, errors.yaw_noise))
        yaw_rate = true.yaw_rate + errors.yaw_bias + errors.yaw_per_metre * true.vx + turn
        self.twist = Twist(scale * true.vx + speed, scale * true.vy, yaw_rate)

    def update(self, now: int) -> None:
        if self.pose is not None and now > self._last:
            self.pose, self._last = self.pose.moved(self.twist, (now - self._last) / 1e6), now
