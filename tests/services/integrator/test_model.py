import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.attitude import quaternion
from services.integrator.model import BodyPose, Integrator, Twist

SECOND = 1_000_000
CIRCLE = Twist((0.8, 0.1, 0.0), (0.0, 0.0, 1.3))


def start(x: float = 0, y: float = 0, yaw: float = 0) -> BodyPose:
    return BodyPose((x, y, 0.0), quaternion(0, 0, yaw))


def on_the_circle(begin: BodyPose, yaw: float, time: float) -> tuple[float, float, float]:
    """Exact pose after `time` seconds of CIRCLE: the body turns about a centre that it holds to its left."""
    (vx, vy, _), rate = CIRCLE.velocity, CIRCLE.rates[2]
    angle = yaw + rate * time
    x = begin.position[0] + (vx * (math.sin(angle) - math.sin(yaw)) + vy * (math.cos(angle) - math.cos(yaw))) / rate
    y = begin.position[1] + (vx * (math.cos(yaw) - math.cos(angle)) + vy * (math.sin(angle) - math.sin(yaw))) / rate
    return x, y, angle


def heading(pose: BodyPose) -> float:
    return 2 * math.atan2(pose.attitude[2], pose.attitude[3])


@pytest.mark.parametrize("period", [1_000, 10_000, 100_000, 700_000])
def test_a_circle_is_exact_whatever_the_step(period: int) -> None:
    body = Integrator(start(1, 2, 0.7))
    body.update(0)
    body.feed(CIRCLE, 0)
    for now in range(period, 7 * SECOND + 1, period):
        pose = body.update(now)
    x, y, angle = on_the_circle(start(1, 2), 0.7, 7.0)
    assert pose.position == pytest.approx((x, y, 0.0), abs=1e-9)
    assert math.remainder(heading(pose) - angle, math.tau) == pytest.approx(0, abs=1e-9)


def test_a_twist_holds_from_its_own_time_on() -> None:
    body = Integrator(start())
    body.update(0)
    body.feed(Twist((1.0, 0.0, 0.0)), 250_000)
    body.feed(Twist((3.0, 0.0, 0.0)), 750_000)
    assert body.update(SECOND).position == pytest.approx((0.5 + 0.75, 0, 0))


@given(
    st.lists(st.tuples(st.integers(0, 100), st.floats(-2, 2), st.floats(-5, 5)), max_size=12),
    st.lists(st.integers(1, 100), max_size=12),
)
def test_when_updates_fall_makes_no_difference(twists: list[tuple[int, float, float]], updates: list[int]) -> None:
    once, often = Integrator(start()), Integrator(start())
    once.update(0)
    often.update(0)
    for body in (once, often):
        for time, vx, rate in twists:
            body.feed(Twist((vx, 0.0, 0.0), (0.0, 0.0, rate)), time * 10_000)
    for now in sorted(updates):
        often.update(now * 10_000)
    assert often.update(SECOND).position == pytest.approx(once.update(SECOND).position, abs=1e-9)


def test_reset_goes_back_to_the_start_and_stands() -> None:
    body = Integrator(start(1, 2, 0.7))
    body.update(0)
    body.feed(CIRCLE, 0)
    body.update(SECOND)
    body.feed(CIRCLE, 2 * SECOND)
    body.reset()
    assert body.update(3 * SECOND) == start(1, 2, 0.7)
    body.feed(CIRCLE, 3 * SECOND)
    assert body.update(4 * SECOND).position[:2] == pytest.approx(on_the_circle(start(1, 2), 0.7, 1.0)[:2])
