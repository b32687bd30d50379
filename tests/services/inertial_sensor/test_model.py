"""Readings against the derivatives of drives, and against geometry."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from dodo_dsl.opendlv.attitude import Vector, quaternion, rotation
from services.dynamic_model.drives import SPEED, BicycleDrive, SingleTrack
from services.dynamic_model.model import STEERING, Vehicle
from services.inertial_sensor.model import (
    UPRIGHT,
    BodyState,
    InertialModel,
    Origin,
    attitude,
    inverse,
    magnetic_field,
    turned,
)
from services.integrator.model import BodyPose, Integrator, Twist, angles

G = 9.81


def upright(yaw: float) -> tuple[Vector, Vector, Vector]:
    matrix = attitude(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    assert matrix is not None
    return matrix


def test_a_sensor_at_rest_reads_gravity_upwards_and_one_on_its_side_along_its_axis() -> None:
    for mount, expected in (
        (UPRIGHT, (0.0, 0.0, G)),
        (rotation(math.pi / 2, 0.0, 0.0), (0.0, G, 0.0)),
        (rotation(0.0, math.pi / 2, 0.0), (-G, 0.0, 0.0)),
        (rotation(0.0, 0.0, 1.0), (0.0, 0.0, G)),
    ):
        model = InertialModel(mount=mount)
        model.feed(BodyState(0))
        assert model.force(upright(2.0)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("lever", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, -0.2, 0.4)])
def test_on_a_circle_it_reads_the_acceleration_to_the_centre(lever: Vector) -> None:
    speed, rate = 2.0, 0.5
    model = InertialModel(lever)
    for number in range(3):
        model.feed(BodyState(number * 10_000, (speed, 0.0, 0.0), (0.0, 0.0, rate)))
        force = model.force(upright(rate * number / 100))
        assert force == pytest.approx((-(rate**2) * lever[0], speed * rate - rate**2 * lever[1], G))
    assert model.rates == (0.0, 0.0, rate)


def test_the_readings_are_the_derivative_of_a_drive() -> None:
    """A car that steers and brakes, at 1 kHz, and the sensor's place differentiated twice."""
    car = SingleTrack(2.7, 1.2, 1.0, 0.6, 0.5, 0.5, 4.0, 8.0, 50.0)
    vehicle, body = Vehicle(BicycleDrive(car)), Integrator(BodyPose((0, 0, 0), quaternion(0, 0, 0.7)))
    lever, mount = (0.8, 0.3, 0.5), rotation(0.1, -0.2, 0.3)
    model = InertialModel(lever, mount)
    places: list[NDArray[np.float64]] = []
    read: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    rates: list[tuple[float, float]] = []
    for number in range(6001):
        now = number * 1000
        vehicle.request(SPEED, 12.0 if number < 4000 else 3.0)
        vehicle.request(STEERING, 0.1 * math.sin(number / 900))
        motion = vehicle.update(now)
        body.feed(Twist((motion.vx, motion.vy, 0.0), (0.0, 0.0, motion.yaw_rate)), now)
        pose = body.update(now)
        matrix = attitude(*pose.attitude)
        assert matrix is not None
        model.feed(BodyState(now, (motion.vx, motion.vy, 0.0), (0.0, 0.0, motion.yaw_rate)))
        if number % 10 == 0:
            places.append(np.array(model.place(matrix, pose.position)))
            force = np.array(turned(matrix, turned(mount, model.force(matrix))))
            read.append((force, np.array(matrix)))
            rates.append((turned(mount, model.rates)[2], angles(pose.attitude)[2]))
    second = np.gradient(np.gradient(np.array(places), 0.01, axis=0), 0.01, axis=0)
    forces = np.array([force for force, _ in read]) - [0.0, 0.0, G]
    assert np.abs(second[5:-5]).max() > 3.0
    middle = (forces[5:-5] + forces[6:-4]) / 2  # a reading is the mean of the time before it
    assert np.abs(middle - second[5:-5]).mean() < 0.02
    turning = np.gradient(np.unwrap([yaw for _, yaw in rates]), 0.01)
    assert np.abs(turning[5:-5] - np.array([rate for rate, _ in rates])[5:-5]).max() < 0.01


def test_the_compass_turns_with_the_body_and_the_sensor() -> None:
    field = magnetic_field(5e-5, math.radians(60), math.radians(10), math.radians(90))
    assert math.hypot(*field) == pytest.approx(5e-5) and field[2] == pytest.approx(-5e-5 * math.sin(math.radians(60)))
    assert math.degrees(math.atan2(field[1], field[0])) == pytest.approx(80)  # east of north, which is y
    for yaw in (0.0, 0.7, 3.0):
        seen = InertialModel(mount=rotation(0, 0, 0.2)).direction(upright(yaw), field)
        assert math.atan2(seen[1], seen[0]) == pytest.approx(math.remainder(math.radians(80) - yaw - 0.2, math.tau))


def test_a_mount_is_as_the_integrator_turns() -> None:
    q = quaternion(0.3, -0.4, 1.1)
    assert np.array(rotation(0.3, -0.4, 1.1)) == pytest.approx(np.array(attitude(*q)))
    assert np.array(inverse(rotation(0.3, -0.4, 1.1))) @ np.array(rotation(0.3, -0.4, 1.1)) == pytest.approx(np.eye(3))
    assert attitude(0, 0, 0, 0) is None and attitude(0, 0, math.nan, 1) is None


@pytest.mark.parametrize(
    ("latitude", "degree_north", "degree_east"),
    [(0, 110_574.3, 111_319.5), (45, 111_131.7, 78_846.8), (60, 111_412.2, 55_800.0)],
)
def test_a_degree_is_as_long_as_tables_of_wgs84_say(latitude: float, degree_north: float, degree_east: float) -> None:
    origin = Origin(latitude, 10.0, 20.0, math.radians(90))
    at_sea = Origin(latitude, 10.0, 0.0, math.radians(90))
    assert at_sea.geolocation((degree_east, degree_north, 3.0)) == pytest.approx((latitude + 1, 11, 3), abs=1e-5)
    assert origin.geolocation((0, 0, 3), 100, 100)[2] == 23


def test_north_turns_the_map_and_headings_are_clockwise_from_it() -> None:
    origin = Origin(57.0, 11.0, 0.0, math.radians(30))
    latitude, longitude, _ = origin.geolocation((math.cos(math.radians(30)), math.sin(math.radians(30)), 0))
    assert latitude > 57 and longitude == pytest.approx(11.0, abs=1e-12)
    assert [origin.heading(math.radians(a)) for a in (30, -60, 60)] == pytest.approx(
        [0, math.pi / 2, math.radians(330)]
    )
