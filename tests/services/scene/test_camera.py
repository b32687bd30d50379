import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.scene.camera import CameraPose, Pinhole, clip, euler_rotation, quaternion_rotation

angles = st.floats(-3.0, 3.0)


def test_right_handed_pitch_lowers_forward_and_roll_lowers_the_right_side():
    assert euler_rotation(0, 0.5, 0) @ [1, 0, 0] == pytest.approx([math.cos(0.5), 0, -math.sin(0.5)])
    assert (euler_rotation(0.5, 0, 0) @ [0, -1, 0])[2] == pytest.approx(-math.sin(0.5))


@settings(deadline=None)
@given(angles, angles, angles)
def test_quaternion_and_euler_angles_agree(roll, pitch, yaw):
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    assert quaternion_rotation(3 * x, 3 * y, 3 * z, 3 * w) == pytest.approx(euler_rotation(roll, pitch, yaw))


@pytest.mark.parametrize("bad", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1)])
def test_what_is_no_rotation_is_refused(bad):
    with pytest.raises(ValueError, match="is not a rotation"):
        quaternion_rotation(*bad)


def test_what_is_carried_moves_and_turns_with_its_body():
    body = CameraPose.at(1, 2, 3, yaw=math.pi / 2)
    camera = body.carrying(CameraPose.at(0.1, 0.2, 0.3, yaw=math.pi / 2))
    assert camera.position == pytest.approx([0.8, 2.1, 3.3])
    assert camera.rotation @ [1, 0, 0] == pytest.approx([-1, 0, 0])


def test_the_pinhole_equation():
    camera = Pinhole(640, 480, math.radians(90))
    assert camera.focal == pytest.approx(240)
    view = camera.view(CameraPose.at(1, 1, 1, yaw=math.pi / 2))
    # 2 m ahead (+y), 0.5 m to the left (-x), 0.25 m up
    u, v = camera.project(view.to_camera(np.array([0.5, 3.0, 1.25])))
    assert (u + 0.5, v + 0.5) == pytest.approx((320 - 240 * 0.5 / 2, 240 - 240 * 0.25 / 2))


@pytest.mark.parametrize(("size", "fovy"), [((0, 1), 1.0), ((1, 0), 1.0), ((4, 4), 0.0), ((4, 4), math.pi)])
def test_impossible_cameras_are_refused(size, fovy):
    with pytest.raises(ValueError, match=r"cannot be drawn|between 0 and 180"):
        Pinhole(*size, fovy)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=3, max_size=3), angles, st.floats(-3, 3))
def test_clipped_polygons_lie_on_the_right_side(corners, angle, offset):
    normal = np.array([math.cos(angle), math.sin(angle)])
    part = clip(np.array(corners), normal, offset)
    assert len(part) <= 4
    assert (part @ normal + offset >= -1e-9).all()
