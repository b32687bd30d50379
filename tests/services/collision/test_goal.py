"""From which side a goal counts, and what a vehicle has to drive where there is none."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
import shapely

from dodo_dsl.opendlv.assets.track import Track, VehicleBox, VehiclePose, fault_of_start
from tests.services.collision.test_model import BEGIN, LANE, SECOND, decided, drive, judge, line

Place = tuple[float, float]
BOX = VehicleBox(0.36, 0.16)
OPEN = LANE
CLOSED = replace(LANE, walls={**LANE.walls, "behind": line(-1, -0.2, -1, 0.2), "beyond": line(5, -0.2, 5, 0.2)})
AROUND = [(-2, 0), (-2, 1), (6, 1), (6, 0), (2, 0)]
ring = shapely.MultiLineString([shapely.box(-r, -r, r, r).exterior.coords for r in (1.8, 2.2)])
LAP = Track({"ring": ring}, {"finish": line(-0.8, -2.2, -0.8, -1.8)}, 99.0)
LAPPED = [(2, -2), (2, 2), (-2, 2), (-2, -2), (-0.5, -2)]
HALL = Track({"hall": line(-3, -3, 6, -3)}, {"finish": line(2, -0.5, 2, 0.5)}, 99.0)


def along(start: Place, way: Sequence[Place]) -> list[tuple[float, float, float, float]]:
    """A vehicle that moves along a way without turning."""
    return [(float(n), x, y, 0.0) for n, (x, y) in enumerate([start, *way])]


@pytest.mark.parametrize(
    ("track", "start", "way", "outcome"),
    [
        pytest.param(OPEN, (0, 0), [(3, 0)], "reached finish", id="ahead"),
        pytest.param(CLOSED, (0, 0), [(3, 0)], "reached finish", id="ahead, in a closed lane"),
        pytest.param(CLOSED, (4, 0), [(3, 0)], "reached finish", id="behind it, in a closed lane: it may reverse"),
        pytest.param(OPEN, (0, 0), AROUND, "did not reach finish", id="out at the start and around"),
        pytest.param(OPEN, (0, 0), [*AROUND, (2.9, 0)], "did not reach finish", id="back onto it, from the right side"),
        pytest.param(OPEN, (0, 0), [*AROUND, (4, 0), (2, 0), (4, 0)], "did not reach finish", id="behind it once more"),
        pytest.param(LAP, (0, -2), LAPPED, "reached finish", id="a lap from past its finish"),
        pytest.param(LAP, (0, -2), [(-1.5, -2)], "did not reach finish", id="back to the finish of a lap"),
        pytest.param(
            HALL, (0, 0), [(0, 2), (4, 2), (4, 0), (2, 0)], "reached finish", id="in a hall, from either side"
        ),
        pytest.param(replace(LAP, walls={}), (0, -2), LAPPED, "reached finish", id="a lap without walls"),
    ],
)
def test_a_goal_counts_from_the_side_to_which_the_course_leads(
    track: Track, start: Place, way: list[Place], outcome: str
) -> None:
    it = judge(track)
    drive(it, *along(start, way))
    if it.verdict is None:
        it.end_of_input(BEGIN + 98 * SECOND)
    assert decided(it).reason.startswith(outcome), decided(it).reason


@pytest.mark.parametrize(
    ("track", "place", "fault"),
    [
        (CLOSED, (0, 0.15), "the vehicle stands on wall left from the start, at x = 0.00 m, y = 0.15 m"),
        (CLOSED, (0, 1), "walls are between the vehicle and finish from the start, at x = 0.00 m, y = 1.00 m"),
        (replace(CLOSED, goal={}, gates=(("g", line(3, -1, 3, 1)),)), (0, 1), None),
        (OPEN, (0, 1), None),
        (CLOSED, (0, 0), None),
    ],
)
def test_a_start_from_which_walls_keep_the_goal_is_a_fault(track: Track, place: Place, fault: str | None) -> None:
    assert fault_of_start(track, VehiclePose(*place, 0.0), BOX) == fault


@pytest.mark.parametrize(
    ("goal", "least", "driven", "reason"),
    [
        ({}, 2.0, 0.0, "drove 0.000 m, expected at least 2 m within 40.00 s"),
        ({}, 2.0, 2.5, "stayed clear of left and right for 40.00 s"),
        ({}, 0.0, 0.0, "stayed clear of left and right for 40.00 s"),
        (LANE.goal, 4.0, 3.0, "drove 3.000 m, expected at least 4 m, although the vehicle reached finish after 1.00 s"),
    ],
)
def test_a_vehicle_that_stands_has_not_driven(
    goal: dict[str, object], least: float, driven: float, reason: str
) -> None:
    it = judge(replace(LANE, goal=goal, min_distance=least))
    drive(it, (0, 0, 0, 0), (1, driven, 0, 0))
    for second in range(42):
        it.request("opendlv.proxy.PedalPositionRequest")
        it.update(BEGIN + second * SECOND)
    assert decided(it).reason == reason
    assert {c.name: c.ok for c in decided(it).checks}["distance"] is (driven >= least)
