import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.assets.trajectory import PathPoint, Trajectory, TrajectoryError, straight, wrapped


def points(*places: tuple[float, ...]) -> list[PathPoint]:
    """Points from (x, y), (x, y, yaw) or (x, y, yaw, time)."""
    return [PathPoint(f"t.csv:{n}", p[0], p[1], 0.0, *p[2:]) for n, p in enumerate(places, 2)]


def test_a_speed_makes_the_times() -> None:
    trajectory = Trajectory(points((0, 0), (3, 4), (3, 6)), speed=2)
    assert trajectory.duration == 3.5
    pose = trajectory.at(1.25)
    assert (pose.x, pose.y) == pytest.approx((1.5, 2))
    assert math.hypot(*trajectory.at(3).velocity) == pytest.approx(2)


def test_every_point_is_met_exactly() -> None:
    table = points((0.1, 0.2, 0.3, 0.0), (0.7, -1.1, -2.9, 0.3), (0.4, 9.9, 3.1, 0.9))
    trajectory = Trajectory(table, speed=1)
    for point in table:
        assert point.time is not None
        pose = trajectory.at(point.time)
        assert (pose.x, pose.y, pose.yaw) == (point.x, point.y, pytest.approx(point.yaw))


def test_heading_turns_by_the_shorter_way_through_the_seam() -> None:
    trajectory = Trajectory(points((0, 0, math.radians(170), 0.0), (1, 0, math.radians(-170), 2.0)), speed=1)
    assert math.degrees(trajectory.at(0.5).yaw) == pytest.approx(175)
    assert math.degrees(trajectory.at(1.5).yaw) == pytest.approx(-175)
    assert trajectory.at(1).yaw_rate == pytest.approx(math.radians(10))


def test_a_straight_way_with_and_without_end() -> None:
    trajectory = straight(1, 2, 0.1, math.pi / 2, 3.0, 0.5)
    assert trajectory.duration == 6
    assert (trajectory.at(2).x, trajectory.at(2).y, trajectory.at(2).z) == pytest.approx((1, 3, 0.1))
    endless = straight(0, 0, 0, 0, None, 0.5)
    assert (endless.duration, endless.at(1000).x) == (math.inf, 500)


@given(st.lists(st.tuples(*[st.floats(-9, 9)] * 3, st.floats(0.01, 3)), min_size=2, max_size=6), st.floats(0, 20))
def test_velocities_are_the_derivatives_of_the_pose(parts: list[tuple[float, float, float, float]], t: float) -> None:
    times = [sum(p[3] for p in parts[:n]) for n in range(len(parts))]
    trajectory = Trajectory(
        points(*((x, y, yaw, time) for (x, y, yaw, _), time in zip(parts, times, strict=True))), speed=1
    )
    step = 1e-6
    if any(abs(t - time) < 2 * step for time in times):
        return
    before, now, after = trajectory.at(t - step), trajectory.at(t), trajectory.at(t + step)
    assert (after.x - before.x) / step / 2 == pytest.approx(now.velocity[0], abs=1e-5 + abs(now.velocity[0]) * 1e-5)
    assert (after.y - before.y) / step / 2 == pytest.approx(now.velocity[1], abs=1e-5 + abs(now.velocity[1]) * 1e-5)
    assert wrapped(after.yaw - before.yaw) / step / 2 == pytest.approx(now.yaw_rate, abs=1e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("places", "sentence"),
    [
        ([(0, 0)], "t.csv:2: expected two way points or more"),
        ([(0, 0), (1, 0), (1, 0)], "t.csv:4: the same position as the point before"),
        ([(0, 0, 0.0, -1.0), (1, 0, 0.0, 2.0)], "t.csv:2: time: -1 is before the start"),
        ([(1, 1, None, 0.0), (1, 1, None, 2.0)], "t.csv:3: all way points are at one position"),
    ],
)
def test_what_makes_no_trajectory(places: list[tuple[float, ...]], sentence: str) -> None:
    with pytest.raises(TrajectoryError, match=sentence):
        Trajectory(points(*places), speed=1)
