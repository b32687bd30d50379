import math

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from dodo_dsl.opendlv.assets.track import VehicleBox, VehiclePose, swept

KIWI = VehicleBox(0.36, 0.16)
places = st.floats(-2, 2)
poses = st.builds(VehiclePose, places, places, st.floats(-math.pi, math.pi))
lines = st.tuples(places, places, places, places).filter(lambda xy: xy[:2] != xy[2:])


def dense(start: VehiclePose, end: VehiclePose, parts: int = 300) -> list[shapely.Polygon]:
    """Brute force: the rectangle at many poses on the way, turned and moved by shapely itself."""
    change = math.remainder(end.heading - start.heading, math.tau)
    shapes = []
    for index in range(parts + 1):
        way = index / parts
        shape = shapely.box(-0.18, -0.08, 0.18, 0.08)
        shape = affinity.rotate(shape, start.heading + way * change, origin=(0, 0), use_radians=True)
        shapes.append(affinity.translate(shape, start.x + way * (end.x - start.x), start.y + way * (end.y - start.y)))
    return shapes


@pytest.mark.slow
@settings(deadline=None)
@given(poses, poses, lines)
def test_the_way_touches_what_any_pose_on_it_touches(
    start: VehiclePose, end: VehiclePose, line: tuple[float, float, float, float]
) -> None:
    obstacle = shapely.LineString([line[:2], line[2:]])
    area = swept(start, end, KIWI)
    shapely.prepare(obstacle)
    brute = shapely.LineString([line[:2], line[2:]])
    shapes = dense(start, end)
    if any(brute.intersects(shape) for shape in shapes):
        assert obstacle.distance(area) < 1e-3
    assert obstacle.intersects(area) == brute.intersects(area)
    if obstacle.intersects(area):
        assert min(brute.distance(shape) for shape in shapes) < 0.03


@given(places, places, places, places, st.floats(-math.pi, math.pi), lines)
def test_a_way_without_a_turn_is_exact(
    x1: float, y1: float, x2: float, y2: float, heading: float, line: tuple[float, float, float, float]
) -> None:
    start, end = VehiclePose(x1, y1, heading), VehiclePose(x2, y2, heading)
    area = swept(start, end, KIWI)
    brute = shapely.union_all([a.union(b).convex_hull for a, b in [(dense(start, end, 1))]])
    assert area.hausdorff_distance(brute) < 1e-9
