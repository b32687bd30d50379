"""The Kiwi car as a single track: steering and pedal in, velocities of the body out.

The equations and constants are those of the public Kiwi simulation: one wheel for each axle, linear tyres,
first-order speed, explicit Euler. SI units; body frame x forward, y left, yaw rate positive to the left.
"""

import math
from dataclasses import dataclass

MICROSECONDS = 1_000_000

MASS = 1.113  # kg
INERTIA = 0.01  # kg m2, about the vertical axis
FRONT, REAR = 0.12, 0.104  # m, centre of mass to each axle
CORNERING_FRONT, CORNERING_REAR = 15.0, 15.0  # N/rad
RESISTANCE = 4.0  # N s/m
GAIN_FORWARD, GAIN_REVERSE = 26.0, 5.0  # N per unit of pedal
STEERING_GAIN = 0.6 / 0.290888  # angle of the wheel per requested angle
STEERING_LIMIT = 0.6  # rad, at the wheel
PEDAL_REVERSE, PEDAL_FORWARD = -0.9, 0.14
SLIP_SPEED = 0.1  # m/s; the tyres carry sideways only above this speed


@dataclass(frozen=True)
class Motion:
    """Velocities of the body: `vx` and `vy` in m/s at the centre of mass, `yaw_rate` in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0


def wheel_angle(request: float) -> float:
    """Angle of the front wheel in rad for a ground steering request in rad: scaled, then limited to 0.6."""
    return max(-STEERING_LIMIT, min(STEERING_LIMIT, STEERING_GAIN * request))


def pedal_position(request: float) -> float:
    """The pedal that the car accepts: limited to -0.9 (reverse) to 0.14 (forward), without unit."""
    return max(PEDAL_REVERSE, min(PEDAL_FORWARD, request))


def step(motion: Motion, wheel: float, pedal: float, dt: float) -> Motion:
    """One explicit Euler step of `dt` seconds with the wheel (rad) and the pedal held."""
    vx, vy, r = motion.vx, motion.vy, motion.yaw_rate
    gain = GAIN_FORWARD if pedal > 0 else GAIN_REVERSE
    next_vx = vx + dt * (gain * pedal - RESISTANCE * vx) / MASS
    speed = abs(vx)
    if speed <= SLIP_SPEED:
        return Motion(next_vx, 0.0, 0.0)
    force_front = CORNERING_FRONT * (wheel - (vy + FRONT * r) / speed)
    force_rear = CORNERING_REAR * (REAR * r - vy) / speed
    next_vy = vy + dt * ((force_front + force_rear) / MASS - vx * r)
    next_r = r + dt * (FRONT * force_front - REAR * force_rear) / INERTIA
    return Motion(next_vx, next_vy, next_r)


class Vehicle:
    """The car through test time: it holds its last requests and advances only in `update`."""

    def __init__(self, freq: float) -> None:
        """`freq` in Hz: the equations are never stepped by more than its period."""
        self.motion = Motion()
        self.rejected = 0
        self._longest = math.ceil(MICROSECONDS / freq)
        self._wheel = 0.0
        self._pedal = 0.0
        self._now: int | None = None

    def steer(self, request: float) -> bool:
        """Take a ground steering request in rad; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._wheel = wheel_angle(request)
        return True

    def press(self, request: float) -> bool:
        """Take a pedal position request; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._pedal = pedal_position(request)
        return True

    def update(self, now: int) -> Motion:
        """Advance to `now` (microseconds) with the requests held; the first call only takes the time.

        Raises ValueError when time runs backwards and ArithmeticError when the steps were too long.
        """
        elapsed = 0 if self._now is None else now - self._now
        if elapsed < 0:
            raise ValueError(f"time ran backwards by {-elapsed} us")
        self._now = now
        steps = -(-elapsed // self._longest)
        for index in range(steps):
            dt = elapsed * (index + 1) // steps - elapsed * index // steps
            self.motion = step(self.motion, self._wheel, self._pedal, dt / MICROSECONDS)
        if not math.isfinite(self.motion.vx + self.motion.vy + self.motion.yaw_rate):
            raise ArithmeticError("the single-track model ran out of bounds: choose a higher freq")
        return self.motion

    def _accepts(self, request: float) -> bool:
        self.rejected += not math.isfinite(request)
        return math.isfinite(request)
