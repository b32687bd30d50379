"""A yaw that turns without end: its index, its headings, its counter, and what else holds as on the other kind."""

import math
from pathlib import Path

import pytest

from services.gantry.rig_table import CIRCLE_COMMANDS, SPEED, TURN, Error, Status
from tests.firmware.programs import CIRCLE_ELF, Bench, Rig

STEP = 2 * math.pi / TURN
BACKWARD = -math.pi
"""The heading at the index, where step 0 is."""
NEAR = (-0.8, -0.6)
FULL_STEPS = 200
"""Of a turn."""


def turn(bench: Bench, rate: float, seconds: float) -> None:
    bench.keep_running(f"0,0,{rate}", seconds)


def turn_until(bench: Bench, rate: float, wanted: Status, patience: float) -> float:
    """How long a turn takes until the rig has a status."""
    for number in range(round(patience / 0.05)):
        bench.send_line(f"$RUN:0,0,{rate}")
        bench.run(0.05)
        if bench.status() == wanted:
            return number * 0.05
    raise AssertionError(f"no {wanted.name} in {patience} s")


def rest(bench: Bench) -> None:
    bench.send_line("$STOP")
    bench.until(Status.IDLE)
    bench.run(0.3)


def test_only_a_circle_has_its_commands(bench: Bench) -> None:
    for word, count in CIRCLE_COMMANDS.items():
        assert bench.send_line(f"${word}:0{',0' * (count - 1)}") == [f"$ERROR:{int(Error.UNKNOWN)}"]


@pytest.mark.parametrize("degrees", [-165.0, 165.0, 171.0, 175.0, 179.9, -179.9])
def test_home_is_the_same_edge_of_the_index_from_either_side_and_from_within(
    circle_program: Path, degrees: float
) -> None:
    with Bench(circle_program, (*NEAR, degrees)) as bench:
        bench.calibrate()
        bench.run(0.3)
        assert bench.position()[2] == pytest.approx(BACKWARD, abs=STEP)
        assert bench.is_true()
        assert bench.happened("slip") == []


@pytest.mark.parametrize(
    ("word", "way"),
    [("GOTO", 0.483), ("GOTOLEFT", 0.483), ("GOTORIGHT", 5.8)],
    ids=["shortest", "left", "right"],
)
@pytest.mark.thorough
def test_a_heading_is_reached_the_way_round_that_is_asked_for(circle: Bench, word: str, way: float) -> None:
    circle.go(0, 0, 2.9)
    circle.extremes()
    assert circle.send_line(f"${word}:0,0,-2.9") == []
    circle.until(Status.IDLE)
    circle.run(0.2)
    assert circle.extremes()["way"][2] == pytest.approx(way, abs=0.01)
    assert circle.position()[2] == pytest.approx(-2.9, abs=STEP)
    assert circle.is_true()
    assert circle.send_line(f"${word}:0,0,-2.9") == []
    circle.run(0.2)
    assert circle.extremes()["way"][2] == 0, "it is there, and turns no whole turn"


def test_a_heading_has_the_names_of_one_turn_to_either_side(circle: Bench) -> None:
    circle.go(0, 0, 2 * math.pi - 0.2)
    assert circle.position()[2] == pytest.approx(-0.2, abs=STEP)
    for beyond in (6.2832, -6.2832):
        assert circle.send_line(f"$GOTO:0,0,{beyond}") == [f"$ERROR:{int(Error.BOUNDS)}"]
    assert circle.send_line("$GOTOLEFT:0.96,0,0") == [f"$ERROR:{int(Error.BOUNDS)}"]
    assert circle.send_line(f"$RUN:0,0,{SPEED['yaw'] + 1e-6:.6f}") == [f"$ERROR:{int(Error.BOUNDS)}"]


@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_it_turns_on_and_on_and_nothing_adds_up(circle: Bench, rate: float) -> None:
    """The index passes by without a stop, and is no limit."""
    turn(circle, rate, 0.8)
    before = circle.extremes()["way"][2]
    turn(circle, rate, 13)
    assert circle.extremes()["way"][2] - before > 11.8, "it slows down nowhere"
    edges = [one for one in circle.events if one["event"] == "closed" and one["motor"] == "alpha"]
    assert len(edges) > 2
    rest(circle)
    assert circle.is_true()


def spin(bench: Bench, turns: int, rate: float) -> None:
    """Let the counter jump by whole turns while the motor speeds up, as many turns would have it."""
    turn(bench, rate, 0.3)
    bench.command(f"miscount alpha {math.copysign(turns, -rate) * FULL_STEPS:.0f}")
    turn(bench, rate, 0.2)


def wind(bench: Bench, rate: float) -> None:
    """Within a turn of where the counter wraps around."""
    spin(bench, 50, rate)
    turn(bench, 0, 1.2)
    spin(bench, 31 if rate > 0 else 32, rate)


@pytest.mark.parametrize("rate", [0.9, -0.9])
def test_a_counter_that_wraps_around_changes_no_heading(circle: Bench, rate: float) -> None:
    """It has 22 bits, which are 163.84 turns."""
    wind(circle, rate)
    turn(circle, rate, 8)
    rest(circle)
    assert circle.is_true()
    circle.go(0, 0, 1)
    assert circle.is_true()
    circle.command("restart")
    circle.run(0.1)
    assert circle.status() == Status.IDLE, "the counter was set back into its turn at rest"
    assert circle.is_true()


def test_a_reset_does_not_take_up_a_heading_when_the_counter_may_have_wrapped(circle: Bench) -> None:
    spin(circle, 45, 0.9)
    assert circle.send_line("$RUN:0,0,0.9") == []
    circle.command("restart")
    circle.run(1.5)
    assert circle.status() == Status.NOT_CALIBRATED
    circle.calibrate()
    circle.run(0.3)
    assert circle.is_true()


@pytest.mark.thorough
def test_homing_forgets_how_many_turns_there_were(circle: Bench) -> None:
    wind(circle, 0.9)
    turn(circle, 0.9, 8)
    circle.calibrate()
    circle.run(0.3)
    assert circle.is_true()


def test_stop_keeps_a_position_however_many_turns_it_has(circle: Bench) -> None:
    spin(circle, 45, 0.9)
    rest(circle)
    assert circle.status() == Status.IDLE
    assert circle.is_true()


@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.parametrize("steps", [4, -4])
@pytest.mark.thorough
def test_a_motor_that_lost_steps_is_noticed_at_the_index_within_a_turn(circle: Bench, rate: float, steps: int) -> None:
    """Four full steps are the least that a motor slips by."""
    turn(circle, rate, 0.2)
    circle.command(f"miscount alpha {steps}")
    assert turn_until(circle, rate, Status.STALL, 8) > 2
    circle.run(1.2)
    assert not circle.pose()["moves"]
    circle.send_line("$STOP")
    assert circle.status() == Status.NOT_CALIBRATED
    circle.calibrate()
    circle.run(0.3)
    assert circle.is_true()


@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.thorough
def test_an_index_that_is_lost_is_noticed_within_a_turn_and_when_homing(circle: Bench, rate: float) -> None:
    circle.command("switch alpha open")
    turn_until(circle, rate, Status.STALL, 8)
    circle.run(1)
    circle.send_line("$STOP")
    circle.extremes()
    circle.send_line("$CALIBRATE")
    circle.until(Status.FAULT)
    assert 2 * math.pi < circle.extremes()["way"][2] < 8, "it looks all around, once"
    circle.send_line("$STOP")
    assert circle.status() == Status.NOT_CALIBRATED


def test_an_index_that_is_stuck_stops_the_rig_softly_and_lets_nothing_move(circle: Bench) -> None:
    circle.keep_running("0.2,0,0.5", 0.8)
    circle.command("switch alpha closed")
    circle.run(0.05)
    assert circle.status() == Status.STALL
    circle.run(1)
    assert circle.happened("slip") == []
    circle.send_line("$STOP")
    for line in ("$RUN:0,0,0.1", "$GOTO:0,0,0", "$GOTOLEFT:0,0,0"):
        assert circle.send_line(line) == [f"$ERROR:{int(Error.UNCALIBRATED)}"]
    circle.extremes()
    circle.send_line("$CALIBRATE")
    circle.until(Status.FAULT)
    assert circle.extremes()["way"][2] < 1


def test_the_other_axes_have_their_edges_and_switches(circle: Bench) -> None:
    circle.go(0.8, 0, 0)
    circle.keep_running("0.5,0,0.9", 2)
    assert circle.pose()["x"] <= 0.95
    circle.command("switch x closed")
    circle.run(0.02)
    assert circle.status() == Status.LIMIT


def test_the_binary_turns_across_its_index_on_the_emulated_rig(firmware: None) -> None:
    with Rig("--kind", "circle", place=(-0.85, -0.65, 178), elf=CIRCLE_ELF) as rig:
        rig.open()
        rig.calibrate()
        assert rig.is_true()
        rig.go(-0.8, -0.6, 3)
        rig.keep_running("0.05,0,0.8", 1.5)
        assert -math.pi < rig.pose()["yaw"] < -2
        rest(rig)
        assert rig.is_true()
        rig.command("times")
        assert rig.send_line("$RUN:-0.05,0,-0.8\n$POSITION\n$STATUS")[-1] == f"${int(Status.MOVING)}"
        rig.run(0.4)
        rig.close()
        rig.run(2)
        assert not rig.pose()["moves"], "it brakes when nobody is there"
        assert rig.command("times")[0]["loop"] < 0.006
