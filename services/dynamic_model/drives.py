"""Other drives than the Kiwi car's: two driven wheels, and a car as a bicycle. SI units, body frame as in ``model``.

Two wheels follow their requests by a first-order lag and roll; the bicycle is the single track of a larger car whose
wheels only roll. Friction limits what the ground gives either of them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from services.dynamic_model.model import STEERING, BodyMotion, KiwiDrive, Reading, limited, speed_and_steering

GRAVITY = 9.81  # m/s2
LEFT, RIGHT = "left", "right"
SPEED, ACCELERATION = "speed", "acceleration"
"""Actuators: two wheels; what drives a bicycle."""

WHEEL_READING = "opendlv.proxy.AxleAngularVelocityReading"


@dataclass(frozen=True)
class TwoWheels:
    """Parameters of a car with two driven wheels beside each other, as ``service.yml`` explains them, in SI units."""

    wheel_radius: float
    track: float
    top_wheel_speed: float
    motor_lag: float
    dead_zone: float
    axle_offset: float
    wheel_offset: float
    friction: float
    slip: float = 0.0
    max_speed: float = math.inf
    max_yaw_rate: float = math.inf
    max_acceleration: float = math.inf


@dataclass
class DifferentialDrive:
    """Two wheels by pedals, or by angular velocities with ``by_axle``; by requests of motion always."""

    car: TwoWheels
    by_axle: bool = False
    power: float = 1.0
    left: float = field(default=0.0, init=False)
    right: float = field(default=0.0, init=False)
    """How fast the wheels turn, in rad/s."""

    @property
    def rest(self) -> Mapping[str, float]:
        return {LEFT: 0.0, RIGHT: 0.0}

    def accepted(self, actuator: str, request: float) -> float:
        """The speed in rad/s at which the wheel will turn, for a pedal or an angular velocity in rad/s."""
        top = self.car.top_wheel_speed * self.power
        speed = limited(request, top) if self.by_axle else top * self._beyond_dead_zone(limited(request, 1.0))
        return self._uneven(actuator, speed)

    def following(self, motion: BodyMotion) -> Mapping[str, float]:
        """The wheels' speeds in rad/s; where one would be too fast, both are slower, and the radius stays."""
        car, top = self.car, self.car.top_wheel_speed * self.power
        vx, rim = limited(motion.vx, car.max_speed), limited(motion.yaw_rate, car.max_yaw_rate) * car.track / 2
        wheels = {LEFT: (vx - rim) / car.wheel_radius, RIGHT: (vx + rim) / car.wheel_radius}
        share = min(1.0, top / max(map(abs, (top, *wheels.values()))))
        return {name: self._uneven(name, speed * share) for name, speed in wheels.items()}

    def _uneven(self, wheel: str, speed: float) -> float:
        return speed * (1 + (self.car.wheel_offset if wheel == RIGHT else -self.car.wheel_offset) / 2)

    def _beyond_dead_zone(self, pedal: float) -> float:
        dead = self.car.dead_zone
        return math.copysign(max(abs(pedal) - dead, 0.0) / (1 - dead), pedal)

    def step(self, motion: BodyMotion, asked: Mapping[str, float], dt: float) -> BodyMotion:
        car = self.car
        share = -math.expm1(-dt / car.motor_lag) if car.motor_lag > 0 else 1.0
        most = car.max_acceleration * dt / car.wheel_radius
        self.left += limited(share * (asked[LEFT] - self.left), most)
        self.right += limited(share * (asked[RIGHT] - self.right), most)
        radius = car.wheel_radius * (1 - car.slip)
        rolling = radius * (self.left + self.right) / 2
        turning = radius * (self.right - self.left) / car.track
        ground = car.friction * GRAVITY
        if abs(motion.vx * turning) > ground:
            turning = math.copysign(ground / abs(motion.vx), turning)
        rest = math.sqrt(max(ground**2 - (motion.vx * turning) ** 2, 0.0))
        vx = motion.vx + limited(rolling - motion.vx, rest * dt)
        return BodyMotion(vx, car.axle_offset * turning, turning)

    def reset(self) -> None:
        self.left = self.right = 0.0

    def odometry(self, motion: BodyMotion, asked: Mapping[str, float]) -> tuple[Reading, ...]:
        """How fast the wheels turn, in rad/s, whether they slip or not: the left one as 0, the right one as 1."""
        speeds = enumerate((self.left, self.right))
        return tuple(Reading(WHEEL_READING, "axleAngularVelocity", stamp, speed) for stamp, speed in speeds)


@dataclass(frozen=True)
class SingleTrack:
    """Parameters of a car that steers with its front wheels, as ``service.yml`` explains them, in SI units."""

    wheel_base: float
    cg: float
    friction: float
    max_steering: float
    steering_rate: float
    speed_lag: float
    max_acceleration: float
    max_braking: float
    top_speed: float

    def __post_init__(self) -> None:
        """Raises ValueError for a centre of mass that is not between the axles."""
        if self.cg >= self.wheel_base:
            raise ValueError(f"--cg={self.cg:g} is not before the rear axle: --wheel-base={self.wheel_base:g}")


@dataclass
class BicycleDrive:
    """A car by steering and speed, or by steering and acceleration unless it is ``by_speed``; by motion to speeds."""

    car: SingleTrack
    by_speed: bool = True
    power: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        self.wheel = self.offset
        """Angle of the front wheel, in rad."""

    @property
    def rest(self) -> Mapping[str, float]:
        return {STEERING: self.offset, SPEED if self.by_speed else ACCELERATION: 0.0}

    def accepted(self, actuator: str, request: float) -> float:
        if actuator == STEERING:
            return limited(request, self.car.max_steering) + self.offset
        return limited(request, self.car.top_speed) if self.by_speed else request

    def following(self, motion: BodyMotion) -> Mapping[str, float]:
        """The speed, and the angle of the wheel that rolls on the circle; a car that stands cannot turn."""
        vx = limited(motion.vx, self.car.top_speed)
        wheel = math.atan(self.car.wheel_base * motion.yaw_rate / vx) if vx else 0.0
        return {SPEED: vx, STEERING: limited(wheel, self.car.max_steering) + self.offset}

    def step(self, motion: BodyMotion, asked: Mapping[str, float], dt: float) -> BodyMotion:
        """By the Runge-Kutta method of fourth order; the wheel turns meanwhile."""
        first = self._acceleration(motion.vx, asked)
        second = self._acceleration(motion.vx + dt / 2 * first, asked)
        third = self._acceleration(motion.vx + dt / 2 * second, asked)
        fourth = self._acceleration(motion.vx + dt * third, asked)
        vx = motion.vx + dt * ((first + 2 * second + 2 * third + fourth) / 6)
        if SPEED not in asked:  # brakes end at a standstill
            vx = limited(max(vx, 0.0), self.car.top_speed)
        self.wheel += limited(asked[STEERING] - self.wheel, self.car.steering_rate * dt)
        return self._rolling(vx)

    def reset(self) -> None:
        self.wheel = self.offset

    def odometry(self, motion: BodyMotion, asked: Mapping[str, float]) -> tuple[Reading, ...]:
        return speed_and_steering(motion.vx, self.wheel)

    def _rolling(self, vx: float) -> BodyMotion:
        """The motion of wheels that roll where they point, as far as friction holds it on its circle."""
        yaw_rate = vx * math.tan(self.wheel) / self.car.wheel_base
        if abs(vx * yaw_rate) > self.car.friction * GRAVITY:
            yaw_rate = math.copysign(self.car.friction * GRAVITY / abs(vx), yaw_rate)
        return BodyMotion(vx, (self.car.wheel_base - self.car.cg) * yaw_rate, yaw_rate)

    def _acceleration(self, vx: float, asked: Mapping[str, float]) -> float:
        """Along the body, in m/s2, as motor, brakes and friction give it."""
        by_speed = SPEED in asked
        wanted = (asked[SPEED] - vx) / self.car.speed_lag if by_speed else asked[ACCELERATION]
        pushes = wanted * vx >= 0 and (wanted >= 0 or by_speed)
        most = self.car.max_acceleration if pushes else self.car.max_braking
        given = limited(wanted, most) * (self.power if pushes else 1.0)
        return limited(given, self.car.friction * GRAVITY)


Drive = KiwiDrive | DifferentialDrive | BicycleDrive
