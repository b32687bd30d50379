import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from dodo_dsl.opendlv.attitude import quaternion
from services.integrator.model import angles, displacement, rotate, turn

rates = st.tuples(*[st.floats(-20, 20)] * 3)
velocities = st.tuples(*[st.floats(-2, 2)] * 3)


@settings(deadline=None)
@given(velocities, rates, st.floats(0, 2))
def test_a_step_is_the_exponential_of_the_motion(
    v: tuple[float, float, float], w: tuple[float, float, float], dt: float
) -> None:
    """Against scipy's matrix exponential of the twist, which knows nothing of closed forms."""
    twist = np.array([[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]])
    moved = expm(twist * dt)
    assert displacement(v, w, dt) == pytest.approx(tuple(moved[:3, 3]), abs=1e-9)
    turned = [rotate(turn(w, dt), axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    assert np.allclose(np.array(turned).T, moved[:3, :3], atol=1e-9)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_looking_straight_up_or_down_all_turn_is_yaw(pitch: float) -> None:
    for roll, yaw in ((0.3, 0.5), (-2.0, 1.0), (0.0, 3.0)):
        q = quaternion(roll, pitch, yaw)
        found = angles(q)
        assert found[:2] == (0.0, pitch)
        assert abs(sum(a * b for a, b in zip(quaternion(*found), q, strict=True))) == pytest.approx(1)
