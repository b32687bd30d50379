"""Two wheels and the bicycle against closed-form solutions."""

import math
from dataclasses import replace

import pytest

from services.dynamic_model.drives import (
    ACCELERATION,
    GRAVITY,
    LEFT,
    RIGHT,
    SPEED,
    BicycleDrive,
    DifferentialDrive,
    Drive,
    SingleTrack,
    TwoWheels,
)
from services.dynamic_model.model import STEERING, BodyMotion, Vehicle
from services.integrator.model import BodyPose, Integrator, Twist

SECOND = 1_000_000
WHEELS = TwoWheels(
    wheel_radius=0.03, track=0.15, top_wheel_speed=30.0, motor_lag=0.1, dead_zone=0.1, axle_offset=0.0,
    wheel_offset=0.0, friction=1.0,
)  # fmt: skip
CAR = SingleTrack(
    wheel_base=2.7, cg=1.2, friction=1.0, max_steering=0.6, steering_rate=0.5, speed_lag=0.5, max_acceleration=4.0,
    max_braking=8.0, top_speed=50.0,
)  # fmt: skip


def driven(drive: Drive, seconds: float, requests: dict[str, float], freq: int = 100) -> Vehicle:
    vehicle = Vehicle(drive)
    vehicle.update(0)
    for actuator, value in requests.items():
        vehicle.request(actuator, value)
    for number in range(1, round(seconds * freq) + 1):
        vehicle.update(number * SECOND // freq)
    return vehicle


def radius(vehicle: Vehicle, seconds: float = 2.0) -> float:
    """Of the circle on which the body goes on, through three of its places."""
    body, motion = Integrator(BodyPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))), vehicle.motion
    body.update(0)
    body.feed(Twist((motion.vx, motion.vy, 0.0), (0.0, 0.0, motion.yaw_rate)), 0)
    a, b, c = ((0.0, 0.0), *(body.update(round(part * seconds * SECOND)).position[:2] for part in (0.5, 1.0)))
    sides = [math.dist(*pair) for pair in ((a, b), (b, c), (c, a))]
    area = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) / 2
    return math.prod(sides) / (4 * area)


@pytest.mark.parametrize(("left", "right"), [(10.0, 12.0), (12.0, 10.0), (-10.0, -8.0), (0.0, 6.0)])
def test_two_wheels_roll_on_the_circle_of_their_speeds(left: float, right: float) -> None:
    vehicle = driven(DifferentialDrive(WHEELS, by_axle=True), 3.0, {LEFT: left, RIGHT: right})
    assert radius(vehicle) == pytest.approx(
        0.075 * (right + left) / (right - left) * math.copysign(1, left + right), rel=1e-6
    )
    assert vehicle.motion.vx == pytest.approx(0.03 * (left + right) / 2, rel=1e-6)


@pytest.mark.parametrize("freq", [50, 100, 1000])
def test_a_wheel_follows_the_first_order_response_whatever_the_steps(freq: int) -> None:
    drive = DifferentialDrive(replace(WHEELS, friction=5.0), by_axle=True)
    vehicle = driven(drive, 0.1, {LEFT: 20.0, RIGHT: 20.0}, freq)
    assert [reading.value for reading in vehicle.odometry] == pytest.approx([20 * (1 - math.exp(-1))] * 2)
    assert vehicle.motion.vx == pytest.approx(0.6 * (1 - math.exp(-1)))


@pytest.mark.parametrize(
    ("pedal", "speed"), [(0.05, 0.0), (-0.1, 0.0), (0.55, 15.0), (-0.55, -15.0), (1.0, 30.0), (7.0, 30.0)]
)
def test_the_pedal_turns_a_wheel_beyond_its_dead_zone(pedal: float, speed: float) -> None:
    drive = DifferentialDrive(WHEELS)
    assert drive.accepted(LEFT, pedal) == pytest.approx(speed)
    assert DifferentialDrive(WHEELS, power=0.5).accepted(RIGHT, pedal) == pytest.approx(speed / 2)


def test_wheels_spin_where_friction_does_not_hold_them() -> None:
    vehicle = driven(DifferentialDrive(replace(WHEELS, friction=0.05, motor_lag=0.0)), 0.5, {LEFT: 1.0, RIGHT: 1.0})
    assert vehicle.motion.vx == pytest.approx(0.05 * GRAVITY * 0.5)
    assert [reading.value for reading in vehicle.odometry] == [30.0, 30.0]
    turned = driven(DifferentialDrive(replace(WHEELS, friction=0.05)), 9.0, {LEFT: 0.5, RIGHT: 0.9}).motion
    assert abs(turned.vx * turned.yaw_rate) <= 0.05 * GRAVITY * 1.001


@pytest.mark.parametrize("drive", [DifferentialDrive(WHEELS), BicycleDrive(CAR)])
def test_a_request_acts_after_the_latency_and_a_reset_forgets_all(drive: DifferentialDrive | BicycleDrive) -> None:
    actuators = [name for name in drive.rest if name != STEERING]
    vehicle = Vehicle(drive, 0.1)
    vehicle.update(0)
    for actuator in actuators:
        vehicle.request(actuator, 1.0)
    assert vehicle.update(100_000).vx == 0.0
    assert vehicle.update(150_000).vx > 0.0
    vehicle.reset()
    assert vehicle.update(900_000) == BodyMotion() and all(reading.value == 0.0 for reading in vehicle.odometry)


def test_the_bicycle_rolls_on_its_circle_at_low_speed() -> None:
    vehicle = driven(BicycleDrive(CAR), 8.0, {STEERING: 0.3, SPEED: 1.0})
    rear_axle = 2.7 / math.tan(0.3)
    assert vehicle.motion.vx == pytest.approx(1.0, rel=1e-6)
    assert radius(vehicle) == pytest.approx(math.hypot(rear_axle, 1.5), rel=1e-5)


def test_the_speed_follows_the_first_order_response() -> None:
    vehicle = driven(BicycleDrive(CAR), 0.5, {SPEED: 1.5})
    assert vehicle.motion.vx == pytest.approx(1.5 * (1 - math.exp(-1)), rel=1e-5)


def test_motor_brakes_and_ground_limit_the_acceleration() -> None:
    def gained(start: float, asked: float, power: float = 1.0, friction: float = 1.0) -> float:
        drive = BicycleDrive(replace(CAR, friction=friction), by_speed=False, power=power)
        vehicle = Vehicle(drive)
        vehicle.motion = BodyMotion(start)
        vehicle.update(0)
        vehicle.request(ACCELERATION, asked)
        return vehicle.update(SECOND).vx - start

    assert [gained(10, 2.0), gained(10, 9.0), gained(10, -20.0)] == pytest.approx([2.0, 4.0, -8.0])
    assert [gained(10, 2.0, power=0.5), gained(10, 9.0, friction=0.1)] == pytest.approx([1.0, 0.1 * GRAVITY])
    assert gained(3, -8.0) == pytest.approx(-3.0)  # and it stands
    assert gained(0, -8.0) == 0.0


def test_a_centre_of_mass_behind_the_rear_axle_is_refused() -> None:
    with pytest.raises(ValueError, match="--cg=3 is not before the rear axle"):
        replace(CAR, cg=3.0)
