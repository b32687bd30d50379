import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.gantry.motion import FARTHEST, HOME, MotionLimits, Shaper, Velocity, box
from services.gantry.protocol import Position

MIDDLE = Position(0, 0, 0)
velocities = st.builds(Velocity, st.floats(-3, 3), st.floats(-3, 3), st.floats(-4, 4))


def settled(body: Velocity, at: Position) -> Velocity:
    shaper = Shaper(MotionLimits())
    for _ in range(200):
        velocity = shaper.step(body, at, 0.05)
    return velocity


def test_the_measured_heading_turns_the_body() -> None:
    velocity = settled(Velocity(0.5, 0, 0.2), Position(0, 0, math.pi / 2))
    assert (velocity.x, velocity.y, velocity.yaw) == pytest.approx((0, 0.5, 0.2))


def test_too_fast_is_cut_without_a_change_of_direction() -> None:
    velocity = settled(Velocity(4, 3, 9), MIDDLE)
    assert velocity.y / velocity.x == pytest.approx(3 / 4)
    assert math.hypot(velocity.x, velocity.y) == pytest.approx(1)
    assert velocity.yaw == 1


def test_speeds_change_no_faster_than_the_accelerations() -> None:
    shaper = Shaper(MotionLimits(acceleration=0.4, yaw_acceleration=0.8))
    velocity = shaper.step(Velocity(1, 0, 1), MIDDLE, 0.05)
    assert (velocity.x, velocity.y, velocity.yaw) == pytest.approx((0.02, 0, 0.04))
    shaper.halt()
    assert shaper.velocity == Velocity()


@settings(deadline=None)
@given(velocities, st.sampled_from([0.01, 0.05, 0.2]))
def test_no_request_drives_the_rig_out_of_its_workspace(body: Velocity, dt: float) -> None:
    """The rig here follows its commands one step late, as real ones do at best."""
    limits = MotionLimits()
    shaper, at, before = Shaper(limits), MIDDLE, Velocity()
    for _ in range(int(6 / dt)):
        velocity = shaper.step(body, at, dt)
        at = Position(at.x + before.x * dt, at.y + before.y * dt, at.yaw + before.yaw * dt)
        before = velocity
        assert math.hypot(velocity.x, velocity.y) <= limits.speed + 1e-9 and abs(velocity.yaw) <= limits.yaw_rate
        assert limits.low.x - 0.002 <= at.x <= limits.high.x + 0.002
        assert limits.low.y - 0.002 <= at.y <= limits.high.y + 0.002
        assert limits.low.yaw - 0.01 <= at.yaw <= limits.high.yaw + 0.01


def test_the_box_is_within_the_rig_whatever_the_ranges() -> None:
    assert box(1.9, 1.4, math.radians(170)) == (HOME, FARTHEST)
    low, high = box(0.5, 0.5, math.radians(90))
    assert (low.x, low.y) == (HOME.x, HOME.y)
    assert (high.x, high.y) == pytest.approx((-0.4, -0.2))
    assert (low.yaw, high.yaw) == pytest.approx((-math.pi / 2, math.pi / 2))
