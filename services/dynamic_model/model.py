"""A car as a single track: steering and pedal in, velocities of the body out.

The equations are those of the public Kiwi simulation: one wheel for each axle, linear tyres, first-order speed.
SI units; body frame x forward, y left, yaw rate positive to the left.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from dodo_dsl.opendlv.assets.car import KIWI, Car
from dodo_dsl.opendlv.envelope import MICROSECONDS

if TYPE_CHECKING:
    from services.dynamic_model.drives import Drive

LONGEST = 5_000
"""Microseconds: no step of the equations is longer, however seldom the model is updated."""
STEERING, PEDAL = "steering", "pedal"
"""Actuators of the Kiwi car."""


@dataclass(frozen=True)
class BodyMotion:
    """Velocities of the body: `vx` and `vy` in m/s at the centre of mass, `yaw_rate` in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0


def limited(value: float, most: float) -> float:
    """The value, at most so far from 0."""
    return max(-most, min(most, value))


_GAMMA = 1 - math.sqrt(0.5)
"""Share of a step that each stage is long: so the method is of second order and L-stable."""


def step(motion: BodyMotion, wheel: float, pedal: float, dt: float, car: Car = KIWI) -> BodyMotion:
    """One step of `dt` seconds with the wheel (rad) and the pedal held; it is stable for any `dt` at every speed.

    It is the diagonally implicit Runge-Kutta method of two stages (R. Alexander, SIAM J. Numer. Anal. 14, 1977, pp.
    1006 to 1021), solved without iterations, as the equations are linear in `vy` and `yaw_rate`.
    """
    if abs(motion.vx) <= car.slip_speed:
        motion = BodyMotion(motion.vx)
    first = _implicit(motion, wheel, pedal, _GAMMA * dt, car)
    pairs = ((motion.vx, first.vx), (motion.vy, first.vy), (motion.yaw_rate, first.yaw_rate))
    second = BodyMotion(*(start + (1 / _GAMMA - 1) * (end - start) for start, end in pairs))
    return _implicit(second, wheel, pedal, _GAMMA * dt, car)


def _implicit(motion: BodyMotion, wheel: float, pedal: float, dt: float, car: Car) -> BodyMotion:
    gain = car.gain_forward if pedal > 0 else car.gain_reverse
    vx = (motion.vx + dt * gain * pedal / car.mass) / (1 + dt * car.resistance / car.mass)
    if abs(vx) <= car.slip_speed:
        return BodyMotion(vx)
    push, turn = dt / car.mass, dt / car.inertia
    front, rear = car.cornering_front / abs(vx), car.cornering_rear / abs(vx)
    moment = car.front * front - car.rear * rear
    a, b = 1 + push * (front + rear), push * moment + dt * vx
    c, d = turn * moment, 1 + turn * (car.front**2 * front + car.rear**2 * rear)
    vy = motion.vy + push * car.cornering_front * wheel
    r = motion.yaw_rate + turn * car.front * car.cornering_front * wheel
    return BodyMotion(vx, (d * vy - b * r) / (a * d - b * c), (a * r - c * vy) / (a * d - b * c))


class Reading(NamedTuple):
    """A message of odometry with one field, in SI units."""

    message: str
    field: str
    sender_stamp: int
    value: float


def speed_and_steering(speed: float, wheel: float) -> tuple[Reading, Reading]:
    """The odometry of a car that steers: m/s over ground, and the front wheel's angle in rad."""
    by_name = (("GroundSpeed", "groundSpeed", speed), ("GroundSteering", "groundSteering", wheel))
    first, second = (Reading(f"opendlv.proxy.{name}Reading", field, 0, value) for name, field, value in by_name)
    return first, second


@dataclass(frozen=True)
class KiwiDrive:
    """The single track of the public Kiwi simulation; as all drives, it is asked in SI units and goes on in time."""

    car: Car = KIWI
    offset: float = 0.0

    @property
    def rest(self) -> Mapping[str, float]:
        """Its actuators, each with what it is asked for at rest."""
        return {STEERING: self.offset, PEDAL: 0.0}

    def accepted(self, actuator: str, request: float) -> float:
        """What an actuator makes of a request: scaled and limited."""
        if actuator == STEERING:
            return limited(self.car.steering_gain * request, self.car.steering_limit) + self.offset
        return self._pedal(request)

    def _pedal(self, request: float) -> float:
        return max(self.car.pedal_reverse, min(self.car.pedal_forward, request))

    def following(self, motion: BodyMotion) -> Mapping[str, float]:
        """The pedal that holds the speed, and the wheel's angle of a steady turn."""
        car = self.car
        gain = car.gain_forward if motion.vx > 0 else car.gain_reverse
        pedal = self._pedal(car.resistance * motion.vx / gain) if gain else 0.0
        vx = gain * pedal / car.resistance
        base, front, rear = car.front + car.rear, car.cornering_front, car.cornering_rear
        gradient = car.mass * (car.rear / front - car.front / rear) / base if front and rear else 0.0
        wheel = motion.yaw_rate * (base + gradient * vx * abs(vx)) / abs(vx) if vx else 0.0
        return {STEERING: limited(wheel, car.steering_limit) + self.offset, PEDAL: pedal}

    def step(self, motion: BodyMotion, asked: Mapping[str, float], dt: float) -> BodyMotion:
        """The motion `dt` seconds later, with the actuators asked for the same all the time."""
        return step(motion, asked[STEERING], asked[PEDAL], dt, self.car)

    def reset(self) -> None: ...

    def odometry(self, motion: BodyMotion, asked: Mapping[str, float]) -> tuple[Reading, ...]:
        return speed_and_steering(motion.vx, asked[STEERING])


class Vehicle:
    """The car through test time: it holds its last requests and advances only in `update`."""

    def __init__(self, drive: "Drive", latency: float = 0.0) -> None:
        """`latency` in s from a request to its effect, counted from the update before the request."""
        self.motion = BodyMotion()
        self.drive = drive
        self._latency = round(latency * MICROSECONDS)
        self._coming: deque[tuple[int, bool, Mapping[str, float]]] = deque()
        """When a request takes effect (us), whether it is one of motion, and what it asks of which actuators."""
        self._asked = dict(self.drive.rest)
        self._follows = False
        self._now: int | None = None

    def request(self, actuator: str, value: float) -> bool:
        """Take a request to an actuator of the drive; False, and nothing changes, when it is not finite."""
        if not math.isfinite(value):
            return False
        self._take(False, {actuator: self.drive.accepted(actuator, value)})
        return True

    def follow(self, motion: BodyMotion) -> bool:
        """Take a request of motion for all actuators; False, and nothing changes, when it is not finite."""
        if not all(map(math.isfinite, (motion.vx, motion.vy, motion.yaw_rate))):
            return False
        self._take(True, self.drive.following(motion))
        return True

    def _take(self, is_motion: bool, accepted: Mapping[str, float]) -> None:
        if self._latency and self._now is not None:
            self._coming.append((self._now + self._latency, is_motion, accepted))
        else:
            self._ask(is_motion, accepted)

    def _ask(self, is_motion: bool, accepted: Mapping[str, float]) -> None:
        """Of the two kinds the last one counts: nothing is left of what the other asked for."""
        if is_motion != self._follows:
            self._asked, self._follows = dict(self.drive.rest), is_motion
        self._asked.update(accepted)

    @property
    def odometry(self) -> tuple[Reading, ...]:
        return self.drive.odometry(self.motion, self._asked)

    def reset(self) -> None:
        """Stand still, with nothing asked of the actuators."""
        self.motion = BodyMotion()
        self._coming.clear()
        self.drive.reset()
        self._asked, self._follows = dict(self.drive.rest), False

    def update(self, now: int) -> BodyMotion:
        """Advance to `now` (microseconds) with the requests held; the first call only takes the time.

        Raises ValueError when time runs backwards and ArithmeticError for a car that swings itself up.
        """
        elapsed = 0 if self._now is None else now - self._now
        if elapsed < 0:
            raise ValueError(f"time ran backwards by {-elapsed} us")
        while self._coming and self._coming[0][0] <= now:
            due, is_motion, accepted = self._coming.popleft()
            self._advance(due - (now - elapsed))
            elapsed = now - due
            self._ask(is_motion, accepted)
        self._advance(elapsed)
        self._now = now
        if not math.isfinite(self.motion.vx + self.motion.vy + self.motion.yaw_rate):
            raise ArithmeticError(
                "the vehicle's model ran out of bounds: the car that its parameters describe is not stable"
            )
        return self.motion

    def _advance(self, elapsed: int) -> None:
        """Steps through `elapsed` us with what is asked of the actuators held."""
        steps = -(-elapsed // LONGEST)
        for index in range(steps):
            dt = elapsed * (index + 1) // steps - elapsed * index // steps
            self.motion = self.drive.step(self.motion, self._asked, dt / MICROSECONDS)
