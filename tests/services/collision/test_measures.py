import math

import pytest
import shapely

from dodo_dsl.opendlv.assets.track import Track, VehiclePose
from services.base import Check
from services.collision.model import DriveMeasures

SECOND = 1_000_000
BARE = Track({}, {}, 1.0)


def at(seconds: float, x: float, y: float = 0.0) -> tuple[int, VehiclePose]:
    return round(seconds * SECOND), VehiclePose(x, y, 0.0)


def test_distance_and_speed_add_up_over_moves() -> None:
    measures = DriveMeasures()
    measures.move(at(0, 0), at(2, 3, 4))
    measures.move(at(2, 3, 4), at(3, 3, 6))
    distance, speed = measures.checks(BARE, 0, None, False)
    assert (distance.value, speed.value) == (pytest.approx(7), pytest.approx(2.5))
    assert distance.ok and speed.ok and not distance.limit


def test_without_a_move_there_is_no_speed() -> None:
    assert [check.value for check in DriveMeasures().checks(BARE, 0, None, False)] == [0.0, None]


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
    assert (
        next(measures.checks(Track({"wall": shapely.Point(0, 0)}, {}, 1.0, min_margin=limit), 0, None, False)) == check
    )


@pytest.mark.parametrize(("time", "crossed"), [(None, 2), (3.5, 3)])
def test_goal_and_gates(time: float | None, crossed: int) -> None:
    track, is_done = Track({}, {}, 40, gates=(("gate", shapely.MultiLineString()),) * 3), time is not None
    goal, gates, *_ = DriveMeasures(time_to_goal=time).checks(track, crossed, None, False)
    assert goal == Check("time-to-goal", time, {"max": 40}, "s", is_done)
    assert gates == Check("gates", crossed, {"min": 3}, "", is_done)
