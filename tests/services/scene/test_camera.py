import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dodo_dsl.opendlv.attitude import rotation
from services.scene.camera import CameraPose, Pinhole, quaternion_rotation

angles = st.floats(-3.0, 3.0)


@settings(deadline=None)
@given(angles, angles, angles)
def test_quaternion_and_euler_angles_agree(roll, pitch, yaw):
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    assert quaternion_rotation(3 * x, 3 * y, 3 * z, 3 * w) == pytest.approx(np.array(rotation(roll, pitch, yaw)))


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
