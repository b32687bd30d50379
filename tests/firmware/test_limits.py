"""Workspace, speed and switches: what the firmware's core never does."""

import pytest

from services.gantry.table import BOUNDS, MICROSTEP, SPEED, Error, Status
from tests.firmware.programs import Bench

AXES = ("x", "y", "yaw")
BEYOND = {"x": 0.000002, "y": 0.000002, "yaw": 0.00002}
QUICK = {"x": "0.9", "y": "0.9", "yaw": "0.9"}


def with_one(axis: str, value: str) -> str:
    return ",".join(value if name == axis else "0" for name in AXES)


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("axis", AXES)
def test_goto_takes_the_bounds_and_nothing_beyond(bench: Bench, axis: str, end: int) -> None:
    bound, sign = BOUNDS[axis][end], (-1, 1)[end]
    assert bench.say(f"$GOTO:{with_one(axis, f'{bound + sign * BEYOND[axis]:.6f}')}") == [f"$ERROR:{int(Error.BOUNDS)}"]
    bench.run(0.1)
    assert bench.extremes()["way"] == [0, 0, 0]
    assert bench.say(f"$GOTO:{with_one(axis, f'{bound:.6f}')}") == []
    bench.until(Status.IDLE)
    assert bench.position()[AXES.index(axis)] == pytest.approx(bound, abs=MICROSTEP[axis])
    assert bench.happened("crash") == []


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize("axis", AXES)
def test_run_takes_the_highest_speed_and_nothing_beyond(bench: Bench, axis: str, sign: str) -> None:
    assert bench.say(f"$RUN:{with_one(axis, f'{sign}1.000001')}") == [f"$ERROR:{int(Error.BOUNDS)}"]
    bench.run(0.1)
    assert bench.extremes()["way"] == [0, 0, 0]
    assert bench.say(f"$RUN:{with_one(axis, f'{sign}{SPEED[axis]:.6f}')}") == []


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize("axis", AXES)
def test_run_brakes_before_the_edge(bench: Bench, axis: str, sign: str) -> None:
    before = len(bench.events)
    bench.keep_running(with_one(axis, sign + QUICK[axis]), 7)
    bench.run(0.1)
    low, high = BOUNDS[axis]
    where, edge = bench.pose()[axis], low if sign else high
    assert low - MICROSTEP[axis] <= where <= high + MICROSTEP[axis]
    assert where == pytest.approx(edge, abs=0.006)
    assert bench.status() in (Status.IDLE, Status.MOVING)
    extremes, index = bench.extremes(), AXES.index(axis)
    assert 0.5 < extremes["speed"][index] <= SPEED[axis]
    assert extremes["ramp"][index] <= (1.0 if axis == "yaw" else 0.5)
    assert bench.events[before:] == []


def test_run_leaves_the_edge(bench: Bench) -> None:
    bench.go(0.95, 0, 0)
    bench.keep_running("-0.2,0,0", 1)
    assert bench.pose()["vx"] == pytest.approx(-0.2, rel=0.02)


def test_a_sudden_turn_towards_the_edge_stays_inside(bench: Bench) -> None:
    bench.go(0.93, 0, 0)
    bench.keep_running("-0.1,0,0", 0.3)
    bench.keep_running("1,0,0", 2)
    assert bench.pose()["x"] <= BOUNDS["x"][1] + MICROSTEP["x"]


def close_in_motion(bench: Bench, motor: str, velocity: str) -> None:
    bench.keep_running(velocity, 0.5)
    bench.order(f"switch {motor} closed")
    bench.run(0.02)


@pytest.mark.parametrize(("motor", "axis"), [("x", "x"), ("y1", "y"), ("y2", "y"), ("alpha", "yaw")])
def test_a_switch_stops_its_axis_at_once_and_the_others_softly(bench: Bench, motor: str, axis: str) -> None:
    close_in_motion(bench, motor, "0.1,0.1,0.3")
    assert bench.status() == Status.LIMIT
    bench.run(0.08)
    pose = bench.pose()
    assert abs(pose[f"v{axis}"]) < 0.005
    others = [abs(pose[f"v{name}"]) for name in AXES if name != axis]
    assert min(others) > 0.01
    assert abs(pose["skew"]) < 0.001
    bench.run(1)
    assert not bench.pose()["moves"]


def test_run_and_goto_wait_for_stop_after_a_switch(bench: Bench) -> None:
    close_in_motion(bench, "x", "0.1,0,0")
    for line in ("$RUN:-0.1,0,0", "$GOTO:0,0,0"):
        assert bench.say(line) == [f"$ERROR:{int(Error.TROUBLE)}"]
    bench.say("$STOP")
    assert bench.status() == Status.IDLE


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("motor", "axis"), [("x", 0), ("y1", 1), ("y2", 1), ("alpha", 2)])
def test_the_direction_of_a_closed_switch_is_blocked(bench: Bench, motor: str, axis: int, sign: int) -> None:
    velocity = ["0", "0", "0"]
    velocity[axis] = str(0.1 * sign)
    close_in_motion(bench, motor, ",".join(velocity))
    bench.say("$STOP")
    bench.run(0.3)
    bench.extremes()
    bench.keep_running(",".join(velocity), 0.5)
    goal = ["0", "0", "0"]
    goal[axis] = str(0.5 * sign)
    assert bench.say(f"$GOTO:{','.join(goal)}") == [f"$ERROR:{int(Error.BLOCKED)}"]
    assert bench.extremes()["way"][axis] == 0
    velocity[axis] = str(-0.1 * sign)
    bench.keep_running(",".join(velocity), 0.5)
    assert bench.extremes()["way"][axis] > 0.02


def test_the_direction_is_free_when_the_switch_has_opened(bench: Bench) -> None:
    close_in_motion(bench, "x", "0.1,0,0")
    bench.say("$STOP")
    bench.run(0.3)
    bench.keep_running("-0.1,0,0", 0.2)
    bench.order("switch x works")
    bench.keep_running("-0.1,0,0", 0.2)
    bench.keep_running("0.1,0,0", 1)
    assert bench.pose()["vx"] == pytest.approx(0.1, rel=0.05)
    assert bench.status() == Status.MOVING


def test_a_rig_that_lost_steps_unnoticed_is_caught_by_its_switch(bench: Bench) -> None:
    """Everything is 5 cm nearer to the far end than the counters say: the switch stops it before the frame."""
    bench.order(f"push x {4 * 42}")
    bench.run(0.2)
    assert bench.status() == Status.STALL
    assert bench.say("$RUN:0.1,0,0") == [f"$ERROR:{int(Error.TROUBLE)}"]
    bench.say("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
    assert bench.say("$RUN:0.1,0,0") == [f"$ERROR:{int(Error.UNCALIBRATED)}"]


def test_a_pair_that_is_not_square_stops(bench: Bench) -> None:
    """A driver that restarted counts from 0."""
    bench.keep_running("0,0.2,0", 0.5)
    bench.order("short y2")
    bench.run(0.1)
    assert bench.status() == Status.FAULT
    pose = bench.pose()
    assert abs(pose["skew"]) < 0.005
    assert abs(pose["vy"]) < 0.005
    bench.say("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
