"""The pose that odometry adds up: exact without errors, and off by each of them as its equation says."""

import math
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.integrator.model import BodyPose, Integrator
from services.integrator.model import Twist as BodyTwist
from services.odometry.model import Errors, Odometer, Pose, Twist
from tests.services.built import built, hand

STATE, COMMAND = "opendlv.sim.KinematicState", "opendlv.sim.Command"
STEP, SECOND = 10_000, 1_000_000
SPEEDS = st.floats(-3, 3)


def after(seconds: float, twist: Twist, seed: int = 0, **errors: float) -> Pose:
    """The pose after a constant twist, told every 10 ms."""
    odometer = Odometer(Errors(**errors), seed)
    for now in range(0, round(seconds * SECOND) + 1, STEP):
        odometer.feed(twist, now)
    assert odometer.pose
    return odometer.pose


@given(st.lists(st.tuples(SPEEDS, SPEEDS, SPEEDS, st.integers(1, 300_000)), max_size=12), st.integers(1, 9))
def test_without_errors_it_is_where_the_integrator_has_it(drive: list[tuple[float, ...]], every: int) -> None:
    """From the start, whenever it is asked, also seldom."""
    odometer, body, now = Odometer(Errors()), Integrator(BodyPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))), 0
    body.update(0)
    odometer.feed(Twist(), 0)
    for number, (vx, vy, yaw_rate, elapsed) in enumerate(drive):
        odometer.feed(Twist(vx, vy, yaw_rate), now)
        body.feed(BodyTwist((vx, vy, 0.0), (0.0, 0.0, yaw_rate)), now)
        now += int(elapsed)
        if number % every == 0:
            odometer.update(now)
    odometer.update(now)
    pose, true = odometer.pose, body.update(now)
    assert pose and (pose.x, pose.y) == pytest.approx(true.position[:2], abs=1e-9)
    heading = 2 * math.atan2(true.attitude[2], true.attitude[3])
    assert math.remainder(pose.yaw - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("errors", "twist", "expected"),
    [
        ({"scale": 0.02}, Twist(0.5), (5.1, 0.0, 0.0)),
        ({"scale": -0.1}, Twist(-0.5, 0.1), (-4.5, 0.9, 0.0)),
        ({"scale": 0.1}, Twist(0.0, 0.0, 1.0), (0.0, 0.0, 10.0)),  # a turn has no distance
        ({"yaw_bias": 0.01}, Twist(), (0.0, 0.0, 0.1)),
        ({"yaw_bias": -0.1}, Twist(0.5), (5 * math.sin(1), 5 * (math.cos(1) - 1), -1.0)),
        ({"yaw_per_metre": 0.2}, Twist(-0.5), (-5 * math.sin(1), 5 * (1 - math.cos(1)), -1.0)),
        ({"yaw_per_metre": 0.2}, Twist(0.0, 0.0, 1.0), (0.0, 0.0, 10.0)),
        ({"speed_noise": 0.1, "yaw_noise": 0.1}, Twist(), (0.0, 0.0, 0.0)),  # it stands
    ],
)
def test_drift(errors: dict[str, float], twist: Twist, expected: tuple[float, float, float]) -> None:
    """After 10 s."""
    assert after(10.0, twist, **errors) == pytest.approx(expected, abs=1e-9)


def test_noise_wanders_as_its_equation_says_and_comes_again_with_its_seed() -> None:
    ways = [after(4.0, Twist(0.5), seed, speed_noise=0.2).x for seed in range(60)]
    assert statistics.fmean(ways) == pytest.approx(2.0, abs=0.03)
    assert statistics.stdev(ways) == pytest.approx(0.2 * math.sqrt(4 * 0.01), rel=0.25)
    turns = [after(4.0, Twist(0.5), seed, yaw_noise=0.1).yaw for seed in range(60)]
    assert statistics.stdev(turns) == pytest.approx(0.1 * math.sqrt(4 * 0.01), rel=0.25)
    assert after(4.0, Twist(0.5), 3, speed_noise=0.2).x == ways[3] and len(set(ways)) == 60


def test_on_the_bus() -> None:
    def reading(now: int) -> list[float]:
        (output,) = service.update(now)
        assert (output.message.DESCRIPTOR.full_name, output.sender_stamp) == ("robot.OdometryReading", 4)
        return [getattr(output.message, name) for name in ("x", "y", "yaw", "vx", "vy", "yawRate")]

    flags = ["--freq=50", "--id=4", "--frame-id=3", "--scale-error=0.1", "--yaw-bias=1", "--yaw-per-metre=2"]
    with built("odometry", *flags) as service:
        hand(service, STATE, 0, 3, vx=2.0, vy=math.nan)
        assert (service.period, service.update(0)) == (20_000, [])
        hand(service, STATE, 0, 3, vx=2.0, vy=0.5, yawRate=0.1)
        turn = 0.1 + math.radians(1 + 2 * 2)
        end = Pose().moved(Twist(2.2, 0.55, turn), 1.0)
        assert reading(0) == pytest.approx([0, 0, 0, 2.2, 0.55, turn])
        assert reading(SECOND) == pytest.approx([*end, 2.2, 0.55, turn], rel=1e-6)
        hand(service, COMMAND, command="reset")
        assert service.update(SECOND) == [], "it begins anew"
        hand(service, STATE, SECOND, 3)
        assert reading(2 * SECOND) == pytest.approx([0, 0, math.radians(1), 0, 0, math.radians(1)])
