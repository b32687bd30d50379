"""Each command of the firmware's core, and what it answers."""

import pytest

from services.gantry.rig_table import LINE_LONGEST, MICROSTEP, SPEED, Error, Status
from tests.firmware.programs import Bench


def error(code: Error) -> list[str]:
    return [f"$ERROR:{int(code)}"]


def test_a_fresh_rig_asks_for_calibrate_and_moves_nothing(fresh: Bench) -> None:
    assert fresh.status() == Status.NOT_CALIBRATED
    for line in ("$POSITION", "$GOTO:0,0,0", "$RUN:0.1,0,0"):
        assert fresh.send_line(line) == error(Error.UNCALIBRATED)
    fresh.run(1)
    assert fresh.extremes()["way"] == [0, 0, 0]


@pytest.mark.thorough
def test_goto_reaches_its_place_within_the_limits(bench: Bench) -> None:
    assert bench.send_line("$GOTO:0.8,-0.6,2.5") == []
    assert bench.status() == Status.MOVING
    bench.until(Status.IDLE)
    wanted = {"x": 0.8, "y": -0.6, "yaw": 2.5}
    for (axis, goal), measured in zip(wanted.items(), bench.position(), strict=True):
        assert abs(measured - goal) <= MICROSTEP[axis]
    extremes = bench.extremes()
    assert all(fast <= most for fast, most in zip(extremes["speed"], SPEED.values(), strict=True))
    assert extremes["ramp"] == pytest.approx([0.5, 0.5, 1.0], rel=0.08)
    assert max(extremes["ramp"][:2]) <= 0.5 and extremes["ramp"][2] <= 1.0


def test_goto_while_moving_brakes_first(bench: Bench) -> None:
    bench.keep_running("0.5,0,0", 1)
    bench.go(-0.2, 0.1, -1)
    assert bench.position()[:2] == pytest.approx((-0.2, 0.1), abs=MICROSTEP["x"])
    assert max(bench.extremes()["ramp"][:2]) <= 0.5


@pytest.mark.parametrize("direction", ["1", "-1"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_run_moves_each_axis_at_its_speed(bench: Bench, axis: int, direction: str) -> None:
    velocity = ["0", "0", "0"]
    velocity[axis] = f"{0.2 * float(direction)}"
    bench.keep_running(",".join(velocity), 1.5)
    pose = bench.pose()
    assert pose[("vx", "vy", "vyaw")[axis]] == pytest.approx(0.2 * float(direction), rel=0.02)
    way = bench.extremes()["way"]
    assert [index for index in range(3) if way[index] > 0] == [axis]


@pytest.mark.thorough
def test_y1_and_y2_stay_square(bench: Bench) -> None:
    bench.keep_running("0,0.4,0", 1.5)
    bench.keep_running("0,-0.4,0", 1.5)
    assert abs(bench.pose()["skew"]) < MICROSTEP["y"]


def test_run_ends_goto(bench: Bench) -> None:
    bench.send_line("$GOTO:0.9,0,0")
    bench.run(0.4)
    bench.keep_running("-0.1,0,0", 1.5)
    assert bench.pose()["vx"] == pytest.approx(-0.1, rel=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("STOP", Error.UNKNOWN),
        ("$", Error.UNKNOWN),
        ("$stop", Error.UNKNOWN),
        ("$STOPP", Error.UNKNOWN),
        ("$STO", Error.UNKNOWN),
        ("x$STOP", Error.UNKNOWN),
        ("$HELP:1", Error.UNKNOWN),
        ("$STOP:1", Error.COUNT),
        ("$POSITION:0,0,0", Error.COUNT),
        ("$GOTO", Error.COUNT),
        ("$GOTO:", Error.COUNT),
        ("$GOTO:0,0", Error.COUNT),
        ("$GOTO:0,0,0,0", Error.COUNT),
        ("$RUN:0,0,", Error.NUMBER),
        ("$RUN:0,,0", Error.NUMBER),
        ("$RUN:0,0,0x1", Error.NUMBER),
        ("$RUN:1e-1,0,0", Error.NUMBER),
        ("$RUN:nan,0,0", Error.NUMBER),
        ("$RUN:--1,0,0", Error.NUMBER),
        ("$RUN:.5,0,0", Error.NUMBER),
        ("$RUN:0.,0,0", Error.NUMBER),
        ("$RUN: 0,0,0", Error.NUMBER),
        ("$RUN:1234567890,0,0", Error.NUMBER),
        ("$RUN:999999999,0,0", Error.BOUNDS),
        ("$RUN:0,-999999999,0", Error.BOUNDS),
        ("$STOP\t", Error.DAMAGED),
        ("$ST\rOP", Error.DAMAGED),
        ("$STOP\0", Error.DAMAGED),
        ("$RUN:0.1,0," + "0" * LINE_LONGEST, Error.DAMAGED),
    ],
)
def test_a_line_with_a_mistake_is_answered_and_moves_nothing(bench: Bench, line: str, code: Error) -> None:
    assert bench.send_line(line) == error(code)
    bench.run(0.1)
    assert bench.extremes()["way"] == [0, 0, 0]


def test_a_mistake_neither_stops_nor_keeps_alive(bench: Bench) -> None:
    bench.keep_running("0.2,0,0", 0.5)
    for _ in range(4):
        assert bench.send_line("$RUN:0.2,0") == error(Error.COUNT)
        bench.run(0.1)
    assert bench.status() == Status.MOVING
    bench.run(0.2)
    assert bench.status() == Status.WATCHDOG


@pytest.mark.parametrize("number", ["0.100000", "+0.1", "0.1000009", "00.1", "0.100000999999"])
def test_numbers_may_be_written_in_many_ways(bench: Bench, number: str) -> None:
    bench.send_line(f"$GOTO:{number},0,0")
    bench.until(Status.IDLE)
    assert bench.position()[0] == pytest.approx(0.1, abs=MICROSTEP["x"])
