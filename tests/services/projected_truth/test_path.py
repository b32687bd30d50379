"""Where the vehicle was between two measured poses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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


def test_where_it_is_not_known() -> None:
    assert MeasuredPath().at(0) is None
    assert path((50_000, 0.1, 0.0)).at(49_999) is None, "before the first pose"
    assert path((0, 0.0, 0.0), (SECOND + 1, 0.1, 0.0)).at(10) is None, "poses too far apart"


def test_poses_that_come_late_or_twice_are_ignored() -> None:
    made = path((0, 0.0, 0.0), (50_000, 0.1, 0.0), (40_000, 9.0, 0.0), (50_000, 9.0, 0.0))
    assert where(made.at(40_000)) == (pytest.approx(0.08), 0.0)
    assert made.reaches(50_000) and not made.reaches(50_001)


@given(st.lists(st.integers(1, SECOND), min_size=1, max_size=8), st.floats(0, 1))
def test_what_moves_on_a_line_stays_on_it(gaps: list[int], share: float) -> None:
    times = np.cumsum([0, *gaps]).tolist()
    made = path(*((time, 1e-7 * time, 0.0) for time in times))
    time = round(share * times[-1])
    assert where(made.at(time)) == (pytest.approx(1e-7 * time, abs=1e-9), pytest.approx(0.0))
