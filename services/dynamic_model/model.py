"""A car as a single track: steering and pedal in, velocities of the body out.

The equations are those of the public Kiwi simulation: one wheel for each axle, linear tyres, first-order speed,
explicit Euler. SI units; body frame x forward, y left, yaw rate positive to the left.
"""

import math
from dataclasses import dataclass

from dodo_dsl.opendlv.inputs.car import KIWI, Car

MICROSECONDS = 1_000_000


@dataclass(frozen=True)
class BodyMotion:
    """Velocities of the body: `vx` and `vy` in m/s at the centre of mass, `yaw_rate` in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0


def wheel_angle(request: float, car: Car = KIWI) -> float:
    """Angle of the front wheel in rad for a ground steering request in rad: scaled, then limited."""
    return max(-car.steering_limit, min(car.steering_limit, car.steering_gain * request))


def pedal_position(request: float, car: Car = KIWI) -> float:
    """The pedal that the car accepts, without unit; negative is reverse."""
    return max(car.pedal_reverse, min(car.pedal_forward, request))


def step(motion: BodyMotion, wheel: float, pedal: float, dt: float, car: Car = KIWI) -> BodyMotion:
    """One explicit Euler step of `dt` seconds with the wheel (rad) and the pedal held."""
    vx, vy, r = motion.vx, motion.vy, motion.yaw_rate
    gain = car.gain_forward if pedal > 0 else car.gain_reverse
    next_vx = vx + dt * (gain * pedal - car.resistance * vx) / car.mass
    speed = abs(vx)
    if speed <= car.slip_speed:
        return BodyMotion(next_vx, 0.0, 0.0)
    force_front = car.cornering_front * (wheel - (vy + car.front * r) / speed)
    force_rear = car.cornering_rear * (car.rear * r - vy) / speed
    next_vy = vy + dt * ((force_front + force_rear) / car.mass - vx * r)
    next_r = r + dt * (car.front * force_front - car.rear * force_rear) / car.inertia
    return BodyMotion(next_vx, next_vy, next_r)


class Vehicle:
    """The car through test time: it holds its last requests and advances only in `update`."""

    def __init__(self, freq: float, car: Car = KIWI, steps: int = 1) -> None:
        """`freq` in Hz: the equations are stepped `steps` times or more in each of its periods."""
        self.motion = BodyMotion()
        self.rejected = 0
        self.car = car
        self._longest = math.ceil(MICROSECONDS / (freq * steps))
        self._wheel = 0.0
        self._pedal = 0.0
        self._now: int | None = None

    def steer(self, request: float) -> bool:
        """Take a ground steering request in rad; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._wheel = wheel_angle(request, self.car)
        return True

    def press(self, request: float) -> bool:
        """Take a pedal position request; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._pedal = pedal_position(request, self.car)
        return True

    def reset(self) -> None:
        """Stand still, with the wheel straight and the pedal let go."""
        self.motion = BodyMotion()
        self._wheel = self._pedal = 0.0

    def update(self, now: int) -> BodyMotion:
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
            self.motion = step(self.motion, self._wheel, self._pedal, dt / MICROSECONDS, self.car)
        if not math.isfinite(self.motion.vx + self.motion.vy + self.motion.yaw_rate):
            raise ArithmeticError("the single-track model ran out of bounds: choose a higher freq or more steps")
        return self.motion

    def _accepts(self, request: float) -> bool:
        self.rejected += not math.isfinite(request)
        return math.isfinite(request)
