"""A car as a single track: steering and pedal in, velocities of the body out.

The equations are those of the public Kiwi simulation: one wheel for each axle, linear tyres, first-order speed,
explicit Euler. SI units; body frame x forward, y left, yaw rate positive to the left.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from dodo_dsl.opendlv.assets.car import KIWI, Car

MICROSECONDS = 1_000_000
STEERING, PEDAL = "steering", "pedal"
"""Actuators of the Kiwi car."""


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
    """Factor of both axles' cornering stiffness, and of the friction"""
    power: float = 1.0
    """Factor of what the motor gives, forward and in reverse"""
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


class Drive(Protocol):
    """What moves: a drive holds what its actuators were asked for, in SI units, and goes on in time."""

    @property
    def rest(self) -> Mapping[str, float]:
        """Its actuators, each with what it is asked for at rest."""

    def accepted(self, actuator: str, request: float) -> float:
        """What an actuator makes of a request: scaled and limited."""

    def step(self, motion: BodyMotion, asked: Mapping[str, float], dt: float) -> BodyMotion:
        """The motion `dt` seconds later, with the actuators asked for the same all the time."""

    def reset(self) -> None:
        """Forget all that moves except the body."""

    def odometry(self, motion: BodyMotion, asked: Mapping[str, float]) -> tuple["Reading", ...]:
        """What its own sensors read."""


class Reading(NamedTuple):
    """A message of odometry with one field, in SI units."""

    message: str
    field: str
    sender_stamp: int
    value: float


def speed_and_steering(speed: float, wheel: float) -> tuple[Reading, Reading]:
    """The odometry of a car that steers: m/s over ground, and the front wheel's angle in rad."""
    return Reading(SPEED_READING, "groundSpeed", 0, speed), Reading(STEERING_READING, "groundSteering", 0, wheel)


SPEED_READING, STEERING_READING = "opendlv.proxy.GroundSpeedReading", "opendlv.proxy.GroundSteeringReading"


@dataclass(frozen=True)
class KiwiDrive:
    """The single track of the public Kiwi simulation."""

    car: Car = KIWI
    offset: float = 0.0
    """rad, at the front wheel"""

    @property
    def rest(self) -> Mapping[str, float]:
        return {STEERING: self.offset, PEDAL: 0.0}

    def accepted(self, actuator: str, request: float) -> float:
        if actuator == STEERING:
            return wheel_angle(request, self.car) + self.offset
        return pedal_position(request, self.car)

    def step(self, motion: BodyMotion, asked: Mapping[str, float], dt: float) -> BodyMotion:
        return step(motion, asked[STEERING], asked[PEDAL], dt, self.car)

    def reset(self) -> None:
        """Nothing but the body moves."""

    def odometry(self, motion: BodyMotion, asked: Mapping[str, float]) -> tuple[Reading, ...]:
        return speed_and_steering(motion.vx, asked[STEERING])


class Vehicle:
    """The car through test time: it holds its last requests and advances only in `update`."""

    def __init__(
        self,
        freq: float,
        car: Car = KIWI,
        steps: int = 1,
        condition: Condition = AS_NEW,
        drive: Drive | None = None,
    ) -> None:
        """`freq` in Hz: the equations are stepped `steps` times or more in each of its periods.

        Without a `drive` it is that of the Kiwi car, with the parameters of `car`.
        """
        self.motion = BodyMotion()
        self.rejected = 0
        self.car = condition.of(car)
        self.drive: Drive = drive or KiwiDrive(self.car, condition.steering_offset)
        self._latency = round(condition.latency * MICROSECONDS)
        self._coming: deque[tuple[int, str, float]] = deque()
        """When a request takes effect (us), and what it asks of which actuator."""
        self._longest = math.ceil(MICROSECONDS / (freq * steps))
        self._asked = dict(self.drive.rest)
        self._now: int | None = None

    def request(self, actuator: str, value: float) -> bool:
        """Take a request to an actuator of the drive; False, and nothing changes, when it is not finite."""
        if not math.isfinite(value):
            self.rejected += 1
            return False
        accepted = self.drive.accepted(actuator, value)
        if self._latency and self._now is not None:
            self._coming.append((self._now + self._latency, actuator, accepted))
        else:
            self._asked[actuator] = accepted
        return True

    def steer(self, request: float) -> bool:
        """Take a ground steering request in rad."""
        return self.request(STEERING, request)

    def press(self, request: float) -> bool:
        """Take a pedal position request."""
        return self.request(PEDAL, request)

    @property
    def odometry(self) -> tuple[Reading, ...]:
        """What the car's own sensors read now."""
        return self.drive.odometry(self.motion, self._asked)

    def reset(self) -> None:
        """Stand still, with nothing asked of the actuators."""
        self.motion = BodyMotion()
        self._coming.clear()
        self.drive.reset()
        self._asked = dict(self.drive.rest)

    def update(self, now: int) -> BodyMotion:
        """Advance to `now` (microseconds) with the requests held; the first call only takes the time.

        Raises ValueError when time runs backwards and ArithmeticError when the steps were too long.
        """
        elapsed = 0 if self._now is None else now - self._now
        if elapsed < 0:
            raise ValueError(f"time ran backwards by {-elapsed} us")
        while self._coming and self._coming[0][0] <= now:
            due, actuator, accepted = self._coming.popleft()
            self._advance(due - (now - elapsed))
            elapsed = now - due
            self._asked[actuator] = accepted
        self._advance(elapsed)
        self._now = now
        if not math.isfinite(self.motion.vx + self.motion.vy + self.motion.yaw_rate):
            raise ArithmeticError("the vehicle's model ran out of bounds: choose a higher freq or more steps")
        return self.motion

    def _advance(self, elapsed: int) -> None:
        """Steps through `elapsed` us with what is asked of the actuators held."""
        steps = -(-elapsed // self._longest)
        for index in range(steps):
            dt = elapsed * (index + 1) // steps - elapsed * index // steps
            self.motion = self.drive.step(self.motion, self._asked, dt / MICROSECONDS)
