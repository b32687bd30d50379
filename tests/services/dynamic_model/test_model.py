import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from dodo_dsl.opendlv.assets.car import KIWI
from services.dynamic_model.model import PEDAL, STEERING, BodyMotion, KiwiDrive, Vehicle

SECOND = 1_000_000


def drive(vehicle: Vehicle, seconds: float, period: int = 10_000, start: int = 0) -> BodyMotion:
    for now in range(start, start + int(seconds * SECOND) + 1, period):
        vehicle.update(now)
    return vehicle.motion


@pytest.mark.parametrize(("pedal", "speed"), [(0.14, 0.91), (1.0, 0.91), (-0.9, -1.125), (-5.0, -1.125), (0.0, 0.0)])
def test_steady_speed(pedal: float, speed: float) -> None:
    vehicle = Vehicle(KiwiDrive())
    vehicle.request(PEDAL, pedal)
    assert drive(vehicle, 10).vx == pytest.approx(speed, abs=1e-9)


def test_steady_turn_agrees_with_the_linear_single_track_model() -> None:
    vehicle = Vehicle(KiwiDrive())
    vehicle.request(PEDAL, 0.1)
    vehicle.request(STEERING, 0.1)
    motion = drive(vehicle, 5)
    base = KIWI.front + KIWI.rear
    balance = KIWI.rear * KIWI.cornering_rear - KIWI.front * KIWI.cornering_front
    gradient = KIWI.mass * balance / (base * KIWI.cornering_front * KIWI.cornering_rear)
    assert motion.yaw_rate == pytest.approx(
        motion.vx * 0.1 * KIWI.steering_gain / (base + gradient * motion.vx**2), rel=1e-7
    )
    assert KIWI.inertia > 0 and motion.yaw_rate > 0


def test_requests_are_scaled_and_limited() -> None:
    steered = [KiwiDrive().accepted(STEERING, request) for request in (0.290888, 0.1, 2, -2)]
    assert steered == pytest.approx([0.6, 0.2062649, 0.6, -0.6], abs=1e-7)
    assert [KiwiDrive().accepted(PEDAL, request) for request in (0.05, 0.5, -1)] == [0.05, 0.14, -0.9]


def test_a_car_that_is_not_stable_is_an_error_and_not_a_state() -> None:
    vehicle = Vehicle(KiwiDrive(replace(KIWI, cornering_rear=0.0, steering_gain=1.0)))
    vehicle.request(PEDAL, 0.14)
    vehicle.request(STEERING, 0.1)
    with pytest.raises(ArithmeticError, match="the car that its parameters describe is not stable"):
        drive(vehicle, 600, period=100_000)


@given(latency=st.integers(0, 300_000), period=st.sampled_from([10_000, 7_000, 50_000]))
def test_a_request_acts_after_the_latency_and_not_before(latency: int, period: int) -> None:
    late, prompt = (Vehicle(KiwiDrive(), seconds) for seconds in (latency / SECOND, 0))
    late.update(0)
    late.request(PEDAL, 0.1)
    for now in range(period, 1_000_001, period):
        moved = late.update(now).vx
        assert (moved > 0) == (now > latency)
    prompt.update(latency)
    prompt.request(PEDAL, 0.1)
    while late.motion.vx < 0.4:
        now += period
        late.update(now)
    assert prompt.update(now).vx == pytest.approx(late.motion.vx, rel=0.02)
