import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.integrator.rotation import displacement, multiply, quaternion, rotate, turn

rates = st.tuples(*[st.floats(-20, 20)] * 3)
velocities = st.tuples(*[st.floats(-2, 2)] * 3)


def test_yaw_turns_forward_to_the_left() -> None:
    q = quaternion(0, 0, math.pi / 2)
    assert rotate(q, (1, 0, 0)) == pytest.approx((0, 1, 0))
    assert rotate(q, (0, 1, 0)) == pytest.approx((-1, 0, 0))


def test_pitch_turns_forward_down_and_roll_turns_left_up() -> None:
    assert rotate(quaternion(0, math.pi / 2, 0), (1, 0, 0)) == pytest.approx((0, 0, -1))
    assert rotate(quaternion(math.pi / 2, 0, 0), (0, 1, 0)) == pytest.approx((0, 0, 1))


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_angles_are_yaw_then_pitch_then_roll(roll: float, pitch: float, yaw: float) -> None:
    parts = multiply(multiply(quaternion(0, 0, yaw), quaternion(0, pitch, 0)), quaternion(roll, 0, 0))
    assert quaternion(roll, pitch, yaw) == pytest.approx(parts, abs=1e-12)


@settings(deadline=None)
@given(velocities, rates, st.floats(0, 0.5))
def test_displacement_is_the_limit_of_ever_smaller_steps(
    v: tuple[float, float, float], w: tuple[float, float, float], dt: float
) -> None:
    parts = 400
    attitude, place = (0.0, 0.0, 0.0, 1.0), [0.0, 0.0, 0.0]
    half = turn(w, dt / parts / 2)
    for _ in range(parts):
        middle = multiply(attitude, half)
        place = [a + b * dt / parts for a, b in zip(place, rotate(middle, v), strict=True)]
        attitude = multiply(middle, half)
    assert displacement(v, w, dt) == pytest.approx(tuple(place), abs=1e-3)
    assert turn(w, dt) == pytest.approx(attitude, abs=1e-9)


@given(velocities, rates, st.floats(0.01, 0.3), st.integers(2, 50))
def test_many_steps_are_one_step(
    v: tuple[float, float, float], w: tuple[float, float, float], dt: float, parts: int
) -> None:
    attitude, place = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    for _ in range(parts):
        moved = rotate(attitude, displacement(v, w, dt / parts))
        place = (place[0] + moved[0], place[1] + moved[1], place[2] + moved[2])
        attitude = multiply(attitude, turn(w, dt / parts))
    assert displacement(v, w, dt) == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize("angle", [0.0499999, 0.05, 0.0500001, 1e-9, 0.0])
def test_small_angles_join_the_closed_form_without_a_step(angle: float) -> None:
    radius = 1 / angle if angle else math.inf
    x, y, z = displacement((1, 0, 0), (0, 0, angle), 1)
    assert z == 0
    assert x == pytest.approx(radius * math.sin(angle) if angle else 1.0, rel=1e-14)
    assert y == pytest.approx(radius * 2 * math.sin(angle / 2) ** 2 if angle else 0.0, rel=1e-14)
