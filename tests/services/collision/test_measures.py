import math

import pytest

from services.base import Check
from services.collision.model import DriveMeasures
from services.collision.track import VehiclePose

SECOND = 1_000_000


def at(seconds: float, x: float, y: float = 0.0) -> tuple[int, VehiclePose]:
    return round(seconds * SECOND), VehiclePose(x, y, 0.0)


def test_distance_and_speed_add_up_over_moves() -> None:
    measures = DriveMeasures()
    measures.move(at(0, 0), at(2, 3, 4))
    measures.move(at(2, 3, 4), at(3, 3, 6))
    distance, speed = measures.drive_checks()
    assert (distance.value, speed.value) == (pytest.approx(7), pytest.approx(2.5))
    assert distance.ok and speed.ok and not distance.limit


def test_without_a_move_there_is_no_speed() -> None:
    assert [check.value for check in DriveMeasures().drive_checks()] == [0.0, None]


@pytest.mark.parametrize(
    ("margins", "limit", "is_kept"),
    [
        ([], 0.0, False),
        ([0.3, 0.1, 0.2], 0.1, True),
        ([0.3, 0.099], 0.1, False),
        ([0.0], 0.0, False),
        ([math.ulp(0.0)], 0.0, True),
    ],
)
def test_the_smallest_margin_keeps_its_limit_and_is_above_zero(
    margins: list[float], limit: float, is_kept: bool
) -> None:
    measures = DriveMeasures()
    for margin in margins:
        measures.approach(margin)
    smallest = min(margins, default=None)
    check = Check("wall-margin", smallest, {"min": limit}, "m", is_kept, exclusive=limit == 0.0)
    assert measures.wall_check(limit) == check


def test_goal_and_gates() -> None:
    assert DriveMeasures().goal_check(40) == Check("time-to-goal", None, {"max": 40}, "s", False)
    assert DriveMeasures(time_to_goal=3.5).goal_check(40) == Check("time-to-goal", 3.5, {"max": 40}, "s", True)
    assert DriveMeasures.gate_check(2, 3) == Check("gates", 2, {"min": 3}, "", False)
    assert DriveMeasures.gate_check(3, 3).ok
