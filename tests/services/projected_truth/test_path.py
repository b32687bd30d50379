"""Where the vehicle was between two measured poses."""

import math

import pytest

from services.projected_truth.path import MeasuredPath
from services.scene.camera import CameraPose

SECOND = 1_000_000


def path(*poses: tuple[int, float, float]) -> MeasuredPath:
    """Of times in us, places along x in m and headings in rad."""
    made = MeasuredPath()
    for time, x, yaw in poses:
        made.add(time, CameraPose.at(x, 0, 0, yaw=yaw))
    return made


def where(pose: CameraPose | None) -> tuple[float, float]:
    assert pose is not None
    return float(pose.position[0]), math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])


def test_between_two_poses_it_moves_evenly() -> None:
    made = path((0, 0.0, 3.0), (50_000, 0.1, 3.1), (100_000, 0.1, -3.1))
    assert where(made.at(50_000)) == (0.1, pytest.approx(3.1))
    assert where(made.at(10_000)) == (pytest.approx(0.02), pytest.approx(3.02))
    assert where(made.at(90_000)) == (pytest.approx(0.1), pytest.approx(-3.1 - (2 * math.pi - 6.2) / 5))


def test_after_the_last_pose_it_moves_on_for_a_second() -> None:
    made = path((0, 0.0, 0.0), (50_000, 0.1, 0.0))
    assert where(made.at(75_000)) == (pytest.approx(0.15), 0.0)
    assert made.at(50_000 + SECOND + 1) is None
    assert where(path((0, 0.3, 0.0)).at(20_000)) == (0.3, 0.0)
