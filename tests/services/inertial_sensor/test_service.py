"""Readings of flags, with noise that a seed repeats."""

import math
import statistics

import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Output
from services.base.flags import load_manifest, parse
from services.inertial_sensor.service import InertialSensor
from tests.services.built import hand

FRAME, STATE = "opendlv.sim.Frame", "opendlv.sim.KinematicState"


def service(**flags: object) -> InertialSensor:
    words = [f"--{name.replace('_', '-')}={value}" for name, value in {"cid": 128, **flags}.items()]
    return InertialSensor(
        Context("imu", parse(load_manifest(package_data.services() / "inertial_sensor"), words), MessageSet.standard())
    )


def drive(sensor: InertialSensor, until: int = 3) -> list[list[Output]]:
    """Readings on a circle to the left, with 2 m/s and 0.5 rad/s, heading north at first."""
    found = []
    for number in range(until):
        yaw = math.pi / 2 + 0.005 * number
        hand(sensor, FRAME, number * 10_000, 0, x=1.0, y=2.0, qz=math.sin(yaw / 2), qw=math.cos(yaw / 2))
        hand(sensor, STATE, number * 10_000, 0, vx=2.0, yawRate=0.5)
        found.append(sensor.update(number * 10_000))
    return found


def test_all_readings_of_a_circle() -> None:
    turning, force, field, place = drive(service(sender=4, frame_id=0))[0]
    assert {each.sender_stamp for each in (turning, force, field, place)} == {4}
    assert (turning.message.angularVelocityX, turning.message.angularVelocityZ) == (0.0, 0.5)
    assert force.message.accelerationY == pytest.approx(1.0) and force.message.accelerationZ == pytest.approx(9.81)
    assert field.message.magneticFieldZ == pytest.approx(-5.1e-5 * math.sin(math.radians(71)))
    assert field.message.magneticFieldY == pytest.approx(
        -5.1e-5 * math.cos(math.radians(71)) * math.sin(math.radians(4))
    )
    assert place.message.heading == pytest.approx(0.0, abs=1e-6)
    assert place.message.latitude == pytest.approx(57.706 + 2 / 111_380, abs=1e-6)
    assert place.message.longitude == pytest.approx(11.937 + 1 / 59_580, abs=1e-6)


def test_nothing_is_sent_before_the_vehicle_is_known_and_only_what_is_asked_for() -> None:
    sensor = service(magnetic_field="false", angular_velocity="false", geolocation="false")
    assert sensor.update(0) == []
    hand(sensor, STATE, 0, 0, vx=1.0)
    assert sensor.update(10_000) == []
    ((reading,), *_) = drive(sensor)
    assert reading.message.DESCRIPTOR.full_name == "opendlv.proxy.AccelerationReading"


def test_noise_has_its_deviation_and_bias_and_comes_again_with_its_seed() -> None:
    flags = {
        "gyro-noise": 2.0,
        "gyro-bias": 3.0,
        "acceleration-noise": 0.2,
        "position-noise": 0.5,
        "heading-noise": 1.0,
    }
    drives = [drive(service(seed=seed, **flags), 1000) for seed in (1, 1, 2)]
    values = [[output.message.SerializeToString() for outputs in one for output in outputs] for one in drives]
    assert values[0] == values[1] != values[2]
    turning = [math.degrees(outputs[0].message.angularVelocityX) for outputs in drives[0]]
    assert (statistics.mean(turning), statistics.stdev(turning)) == (
        pytest.approx(3, abs=0.3),
        pytest.approx(2, abs=0.2),
    )
    ahead = [outputs[1].message.accelerationX for outputs in drives[0]]
    assert (statistics.mean(ahead), statistics.stdev(ahead)) == (
        pytest.approx(0, abs=0.03),
        pytest.approx(0.2, abs=0.02),
    )
    north = [outputs[3].message.latitude * 111_380 for outputs in drives[0]]
    assert statistics.stdev(north) == pytest.approx(0.5, abs=0.06)


def test_what_is_no_motion_is_ignored() -> None:
    sensor = service()
    hand(sensor, FRAME, 0, 0, x=1.0)
    hand(sensor, STATE, 0, 0, vx=math.nan)
    assert sensor.update(0) == []
