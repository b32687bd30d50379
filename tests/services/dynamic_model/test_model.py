import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.car import KIWI
from services.dynamic_model.model import BodyMotion, Condition, Vehicle, pedal_position, wheel_angle

SECOND = 1_000_000


def drive(vehicle: Vehicle, seconds: float, period: int = 10_000, start: int = 0) -> BodyMotion:
    for now in range(start, start + int(seconds * SECOND) + 1, period):
        vehicle.update(now)
    return vehicle.motion


@pytest.mark.parametrize(("pedal", "speed"), [(0.14, 0.91), (1.0, 0.91), (-0.9, -1.125), (-5.0, -1.125), (0.0, 0.0)])
def test_steady_speed(pedal: float, speed: float) -> None:
    vehicle = Vehicle()
    vehicle.press(pedal)
    assert drive(vehicle, 10).vx == pytest.approx(speed, abs=1e-9)


def test_steady_turn_agrees_with_the_linear_single_track_model() -> None:
    vehicle = Vehicle()
    vehicle.press(0.1)
    vehicle.steer(0.1)
    motion = drive(vehicle, 5)
    base = KIWI.front + KIWI.rear
    balance = KIWI.rear * KIWI.cornering_rear - KIWI.front * KIWI.cornering_front
    gradient = KIWI.mass * balance / (base * KIWI.cornering_front * KIWI.cornering_rear)
    assert motion.yaw_rate == pytest.approx(motion.vx * wheel_angle(0.1) / (base + gradient * motion.vx**2), rel=1e-7)
    assert KIWI.inertia > 0 and motion.yaw_rate > 0


def test_requests_are_scaled_and_limited() -> None:
    assert wheel_angle(0.290888) == pytest.approx(0.6)
    assert wheel_angle(0.1) == pytest.approx(0.2062649, abs=1e-7)
    assert (wheel_angle(2), wheel_angle(-2)) == (0.6, -0.6)
    assert (pedal_position(0.05), pedal_position(0.5), pedal_position(-1)) == (0.05, 0.14, -0.9)


def test_time_does_not_run_backwards() -> None:
    vehicle = Vehicle()
    vehicle.update(10)
    with pytest.raises(ValueError, match="backwards by 3 us"):
        vehicle.update(7)


@given(st.integers(1, 2_000_000))
def test_however_seldom_it_is_updated_the_steps_are_fine_and_lose_no_time(elapsed: int) -> None:
    vehicle = Vehicle()
    vehicle.press(0.1)
    vehicle.update(0)
    vehicle.update(elapsed)
    limit, decay = KIWI.gain_forward * 0.1 / KIWI.resistance, KIWI.resistance / KIWI.mass * elapsed / SECOND
    assert vehicle.motion.vx == pytest.approx(-limit * math.expm1(-decay), rel=1e-4)


def test_a_car_that_is_not_stable_is_an_error_and_not_a_state() -> None:
    vehicle = Vehicle(replace(KIWI, cornering_rear=0.0, steering_gain=1.0))
    vehicle.press(0.14)
    vehicle.steer(0.1)
    with pytest.raises(ArithmeticError, match="the car that its parameters describe is not stable"):
        drive(vehicle, 600, period=100_000)


@given(latency=st.integers(0, 300_000), period=st.sampled_from([10_000, 7_000, 50_000]))
def test_a_request_acts_after_the_latency_and_not_before(latency: int, period: int) -> None:
    late, prompt = (Vehicle(condition=Condition(latency=seconds)) for seconds in (latency / SECOND, 0))
    late.update(0)
    late.press(0.1)
    for now in range(period, 1_000_001, period):
        moved = late.update(now).vx
        assert (moved > 0) == (now > latency)
    prompt.update(latency)
    prompt.press(0.1)
    while late.motion.vx < 0.4:
        now += period
        late.update(now)
    assert prompt.update(now).vx == pytest.approx(late.motion.vx, rel=0.02)


def test_a_reset_forgets_what_is_under_way() -> None:
    vehicle = Vehicle(condition=Condition(latency=0.1))
    vehicle.update(0)
    vehicle.press(0.1)
    vehicle.reset()
    assert drive(vehicle, 1).vx == 0


def test_half_the_power_has_half_the_speed_and_less_grip_a_wider_turn() -> None:
    def steady(condition: Condition) -> BodyMotion:
        vehicle = Vehicle(condition=condition)
        vehicle.press(0.14)
        vehicle.steer(0.05)
        return drive(vehicle, 10)

    assert steady(Condition(power=0.5)).vx == pytest.approx(0.455, abs=1e-6)
    full, worn = steady(Condition()), steady(Condition(grip=0.5))
    slip = steady(Condition(grip=0.5)).vy - full.vy
    assert worn.vx == pytest.approx(full.vx) and slip < -0.01, "tyres with less grip slip more to the outside"


def test_the_offset_of_the_steering_is_that_of_the_wheel_in_degrees_of_a_request() -> None:
    bent, asked = Vehicle(condition=Condition(steering_offset=wheel_angle(0.05))), Vehicle()
    for vehicle in (bent, asked):
        vehicle.press(0.1)
    asked.steer(0.05)
    assert drive(bent, 2) == drive(asked, 2)
    bent.steer(-0.05)
    assert drive(bent, 4, start=2_010_000).yaw_rate == pytest.approx(0, abs=1e-6)
