"""A car as a single track: steering and pedal in, velocities of the body out.

The equations are those of the public Kiwi simulation: one wheel for each axle, linear tyres, first-order speed,
explicit Euler. SI units; body frame x forward, y left, yaw rate positive to the left.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

from dodo_dsl.opendlv.assets.car import KIWI, Car

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


@dataclass(frozen=True)
class Condition:
    """How a car differs from its data sheet: worn tyres, a weak battery, a bent steering rod, slow actuators."""

    grip: float = 1.0
    """Factor of both axles' cornering stiffness"""
    power: float = 1.0
    """Factor of the pedal's force, forward and in reverse"""
    steering_offset: float = 0.0
    """rad, added to the front wheel's angle whatever is requested; positive is to the left"""
    latency: float = 0.0
    """s from a request to its effect, a pure delay; counted from the update before the request"""

    def of(self, car: Car) -> Car:
        """The car with its tyres and motor in this condition."""
        return replace(
            car,
            cornering_front=car.cornering_front * self.grip,
            cornering_rear=car.cornering_rear * self.grip,
            gain_forward=car.gain_forward * self.power,
            gain_reverse=car.gain_reverse * self.power,
        )


AS_NEW = Condition()


class Vehicle:
    """The car through test time: it holds its last requests and advances only in `update`."""

    def __init__(self, freq: float, car: Car = KIWI, steps: int = 1, condition: Condition = AS_NEW) -> None:
        """`freq` in Hz: the equations are stepped `steps` times or more in each of its periods."""
        self.motion = BodyMotion()
        self.rejected = 0
        self.car = condition.of(car)
        self._offset = condition.steering_offset
        self._latency = round(condition.latency * MICROSECONDS)
        self._coming: deque[tuple[int, float | None, float | None]] = deque()
        """When a request takes effect (us), and the wheel's angle or the pedal that it sets."""
        self._longest = math.ceil(MICROSECONDS / (freq * steps))
        self._wheel = self._offset
        self._pedal = 0.0
        self._now: int | None = None

    def steer(self, request: float) -> bool:
        """Take a ground steering request in rad; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._take(wheel_angle(request, self.car) + self._offset, None)
        return True

    def press(self, request: float) -> bool:
        """Take a pedal position request; False, and nothing changes, when it is not finite."""
        if not self._accepts(request):
            return False
        self._take(None, pedal_position(request, self.car))
        return True

    def reset(self) -> None:
        """Stand still, with the wheel straight and the pedal let go."""
        self.motion = BodyMotion()
        self._coming.clear()
        self._wheel, self._pedal = self._offset, 0.0

    def update(self, now: int) -> BodyMotion:
        """Advance to `now` (microseconds) with the requests held; the first call only takes the time.

        Raises ValueError when time runs backwards and ArithmeticError when the steps were too long.
        """
        elapsed = 0 if self._now is None else now - self._now
        if elapsed < 0:
            raise ValueError(f"time ran backwards by {-elapsed} us")
        while self._coming and self._coming[0][0] <= now:
            due, wheel, pedal = self._coming.popleft()
            self._advance(due - (now - elapsed))
            elapsed = now - due
            self._apply(wheel, pedal)
        self._advance(elapsed)
        self._now = now
        if not math.isfinite(self.motion.vx + self.motion.vy + self.motion.yaw_rate):
            raise ArithmeticError("the single-track model ran out of bounds: choose a higher freq or more steps")
        return self.motion

    def _take(self, wheel: float | None, pedal: float | None) -> None:
        """Sets the wheel or the pedal, now or after the latency."""
        if self._latency and self._now is not None:
            self._coming.append((self._now + self._latency, wheel, pedal))
        else:
            self._apply(wheel, pedal)

    def _apply(self, wheel: float | None, pedal: float | None) -> None:
        self._wheel = self._wheel if wheel is None else wheel
        self._pedal = self._pedal if pedal is None else pedal

    def _advance(self, elapsed: int) -> None:
        """Steps through `elapsed` us with the wheel and the pedal held."""
        steps = -(-elapsed // self._longest)
        for index in range(steps):
            dt = elapsed * (index + 1) // steps - elapsed * index // steps
            self.motion = step(self.motion, self._wheel, self._pedal, dt / MICROSECONDS, self.car)

    def _accepts(self, request: float) -> bool:
        self.rejected += not math.isfinite(request)
        return math.isfinite(request)
