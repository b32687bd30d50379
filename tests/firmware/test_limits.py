"""Workspace, speed and switches: what the firmware's core never does."""

import pytest

from services.gantry.rig_table import BOUNDS, MICROSTEP, SPEED, Error, Status
from tests.firmware.programs import Bench

AXES = ("x", "y", "yaw")
BEYOND = {"x": 0.000002, "y": 0.000002, "yaw": 0.00002}
QUICK = {"x": "0.9", "y": "0.9", "yaw": "0.9"}
MOTORS = {"x": ("x",), "y": ("y1", "y2"), "yaw": ("alpha",)}
STEPS = {axis: 1 / (128 * step) for axis, step in MICROSTEP.items()}
"""Full steps per m or rad."""
NEAR = {"x": 0.05, "y": 0.05, "yaw": 0.15}
SWITCH = {"x": (0.001, 0.005), "y": (0.001, 0.005), "yaw": (0.0174, 0.0261)}
"""How far beyond the bounds the switches close, at home and at the far end."""
BRAKE = {"x": 0.006, "y": 0.006, "yaw": 0.003}
"""Less than what an axis needs to brake from 0.12 m/s (rad/s)."""
WOBBLE = {"x": 0.0005, "y": 0.0005, "yaw": 0.02}
"""A rotor's oscillation."""


def with_one(axis: str, value: str) -> str:
    return ",".join(value if name == axis else "0" for name in AXES)


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("axis", AXES)
def test_goto_takes_the_bounds_and_nothing_beyond(bench: Bench, axis: str, end: int) -> None:
    bound, sign = BOUNDS[axis][end], (-1, 1)[end]
    assert bench.send_line(f"$GOTO:{with_one(axis, f'{bound + sign * BEYOND[axis]:.6f}')}") == [
        f"$ERROR:{int(Error.BOUNDS)}"
    ]
    bench.run(0.1)
    assert bench.extremes()["way"] == [0, 0, 0]
    assert bench.send_line(f"$GOTO:{with_one(axis, f'{bound:.6f}')}") == []
    bench.until(Status.IDLE)
    assert bench.position()[AXES.index(axis)] == pytest.approx(bound, abs=MICROSTEP[axis])
    assert bench.happened("crash") == []


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize("axis", AXES)
def test_run_takes_the_highest_speed_and_nothing_beyond(bench: Bench, axis: str, sign: str) -> None:
    assert bench.send_line(f"$RUN:{with_one(axis, f'{sign}1.000001')}") == [f"$ERROR:{int(Error.BOUNDS)}"]
    bench.run(0.1)
    assert bench.extremes()["way"] == [0, 0, 0]
    assert bench.send_line(f"$RUN:{with_one(axis, f'{sign}{SPEED[axis]:.6f}')}") == []


@pytest.mark.thorough
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


def close_in_motion(bench: Bench, motor: str, velocity: str) -> None:
    bench.keep_running(velocity, 0.5)
    bench.command(f"switch {motor} closed")
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


@pytest.mark.thorough
def test_after_a_switch_only_calibrate_moves_the_rig(bench: Bench) -> None:
    close_in_motion(bench, "x", "0.1,0,0")
    for line in ("$RUN:-0.1,0,0", "$GOTO:0,0,0"):
        assert bench.send_line(line) == [f"$ERROR:{int(Error.TROUBLE)}"]
    assert bench.status() == Status.LIMIT
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
    for line in ("$RUN:-0.1,0,0", "$GOTO:0,0,0", "$POSITION"):
        assert bench.send_line(line) == [f"$ERROR:{int(Error.UNCALIBRATED)}"]
    bench.command("switch x works")
    bench.calibrate()
    bench.run(0.3)
    assert bench.is_true()


def miscount(bench: Bench, axis: str, far: bool, beyond: float) -> None:
    """Move the counters of an axis, so that its switch lies that much (m, rad) within its measured bounds."""
    steps = beyond * STEPS[axis] * (1 if far else -1)
    for motor in MOTORS[axis]:
        bench.command(f"miscount {motor} {steps:.0f}")


def run_until_limit(bench: Bench, line: str, patience: float = 8.0) -> None:
    """RUN again and again until a switch closes."""
    for _ in range(round(patience / 0.02)):
        if bench.status() == Status.LIMIT:
            return
        bench.send_line(line)
        bench.run(0.02)
    raise AssertionError("no switch closed")


@pytest.mark.parametrize("far", [True, False], ids=["far", "home"])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.thorough
def test_a_switch_hit_while_the_axis_turns_is_left_the_way_it_came(bench: Bench, axis: str, far: bool) -> None:
    """The counter is wrong; the rig is commanded back, and hits the switch while it brakes."""
    sign, index = (1 if far else -1), AXES.index(axis)
    goal = [0.0, 0.0, 0.0]
    goal[index] = BOUNDS[axis][far] - sign * NEAR[axis]
    bench.go(*goal)
    miscount(bench, axis, far, 2 * NEAR[axis])
    turn = sign * BOUNDS[axis][far] + SWITCH[axis][far] - BRAKE[axis]
    while bench.pose()[axis] * sign < turn:
        bench.keep_running(with_one(axis, f"{sign * 0.12}"), 0.01, every=0.01)
    run_until_limit(bench, f"$RUN:{with_one(axis, f'{-sign * 0.12}')}", patience=1)
    assert bench.pose()[axis] * sign > BOUNDS[axis][far] * sign
    bench.send_line("$STOP")
    bench.run(0.2)
    assert bench.send_line(f"$RUN:{with_one(axis, f'{sign * 0.1}')}") == [f"$ERROR:{int(Error.UNCALIBRATED)}"]
    hit = bench.pose()[axis]
    bench.send_line("$CALIBRATE")
    for _ in range(20):
        bench.run(0.02)
        assert bench.pose()[axis] * sign < hit * sign + WOBBLE[axis]
    bench.until(Status.IDLE)
    assert bench.happened("crash") == []


@pytest.mark.parametrize("motor", ["x", "y1", "y2", "alpha"])
def test_a_switch_that_is_stuck_closed_lets_nothing_move(bench: Bench, motor: str) -> None:
    """Both ends share an input, so a stuck switch guards neither: CALIBRATE tries to leave it, and then gives up."""
    close_in_motion(bench, motor, "0.05,0.05,0.1")
    bench.run(1)
    bench.send_line("$STOP")
    bench.extremes()
    for sign in ("", "-"):
        assert bench.send_line(f"$RUN:{sign}0.1,{sign}0.1,{sign}0.1") == [f"$ERROR:{int(Error.UNCALIBRATED)}"]
    assert bench.extremes()["way"] == [0, 0, 0]
    bench.send_line("$CALIBRATE")
    bench.until(Status.FAULT)
    ways = bench.extremes()["way"]
    assert max(ways[:2]) <= 0.022 and ways[2] <= 0.5
    bench.send_line("$STOP")
    assert bench.send_line("$RUN:0.1,0.1,0.1") == [f"$ERROR:{int(Error.UNCALIBRATED)}"]


@pytest.mark.parametrize("far", [True, False], ids=["far", "home"])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.thorough
def test_a_rig_whose_counter_is_wrong_is_caught_by_its_switch(bench: Bench, axis: str, far: bool) -> None:
    """The end is nearer than the counters show."""
    sign = 1 if far else -1
    goal = [0.0, 0.0, 0.0]
    goal[AXES.index(axis)] = BOUNDS[axis][far] - sign * NEAR[axis]
    bench.go(*goal)
    miscount(bench, axis, far, 3 * NEAR[axis])
    run_until_limit(bench, f"$RUN:{with_one(axis, f'{sign * 0.12}')}")
    bench.run(0.3)
    assert not bench.pose()["moves"]
    assert bench.happened("crash") == []
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
