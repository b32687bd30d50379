"""Drivers that do not follow their commands, and how the firmware's core reacts."""

import pytest

from services.gantry.rig_table import Status
from tests.firmware.programs import Bench

MOTORS = ("x", "y1", "y2", "alpha")
SPEED = "0.2,0.2,0.2"


def keep_sending(bench: Bench, velocity: str, seconds: float) -> None:
    """RUN again and again, whatever the answer is."""
    for _ in range(round(seconds / 0.05)):
        bench.send_line(f"$RUN:{velocity}")
        bench.run(0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("line", ["$STOP", "$GOTO:0,0,0", "$CALIBRATE", "$RUN:-0.2,-0.2,-0.2", "$RUN:0,0,0"])
def test_a_driver_that_does_not_obey_loses_its_current(bench: Bench, motor: str, line: str) -> None:
    """It answers and continues. The command is sent again, then all axes brake, and then no motor has current."""
    bench.keep_running(SPEED, 1)
    bench.command(f"deaf {motor} on")
    bench.send_line(line)
    for _ in range(8):
        bench.run(0.05)
        bench.send_line(line if "RUN" in line else "$STATUS")
    bench.run(0.05)
    assert bench.status() == Status.FAULT
    assert not bench.pose()["moves"]
    assert bench.speed() < 1e-3
    bench.command(f"deaf {motor} off")
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.thorough
def test_a_driver_that_goes_the_other_way_is_a_fault_while_speeds_change(bench: Bench, motor: str) -> None:
    bench.keep_running(SPEED, 1)
    bench.command(f"deaf {motor} on")
    for turn in range(8):
        bench.send_line(f"$RUN:-0.{20 + turn},-0.{20 + turn},-0.{20 + turn}")
        bench.run(0.05)
    assert bench.status() == Status.FAULT


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.thorough
def test_a_driver_that_does_not_begin_is_a_fault(bench: Bench, motor: str) -> None:
    bench.command(f"deaf {motor} on")
    keep_sending(bench, "0.1,0.1,0.1", 0.25)
    assert bench.status() == Status.FAULT
    bench.run(0.5)
    assert not bench.pose()["moves"]


@pytest.mark.parametrize("velocity", ["0.1,0.1,0.1", "-0.1,-0.1,-0.1", "0,0,0"])
@pytest.mark.thorough
def test_a_lost_command_is_sent_again(bench: Bench, velocity: str) -> None:
    bench.keep_running(SPEED, 1)
    for motor in MOTORS:
        bench.command(f"deaf {motor} on")
    bench.send_line(f"$RUN:{velocity}")
    bench.run(0.01)
    for motor in MOTORS:
        bench.command(f"deaf {motor} off")
    bench.keep_running(velocity, 1)
    pose = bench.pose()
    wanted = tuple(map(float, velocity.split(",")))
    assert (pose["vx"], pose["vy"], pose["vyaw"]) == pytest.approx(wanted, abs=0.01)
    assert bench.status() == (Status.MOVING if any(wanted) else Status.IDLE)


@pytest.mark.parametrize("motor", ["x", "alpha"])
@pytest.mark.thorough
def test_a_counter_that_does_not_follow_is_a_fault(bench: Bench, motor: str) -> None:
    bench.keep_running(SPEED, 0.6)
    bench.command(f"freeze {motor} on")
    keep_sending(bench, SPEED, 0.25)
    assert bench.status() == Status.FAULT
    bench.run(1)
    assert not bench.pose()["moves"]
    bench.command(f"freeze {motor} off")
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.parametrize("velocity", ["0.003,0,0", "0.05,-0.3,0.01", "1,1,1", "0,0,0.9", "-0.001,-0.001,-0.002"])
@pytest.mark.thorough
def test_drivers_that_obey_cause_no_fault(bench: Bench, velocity: str) -> None:
    """Whatever the speed, at each change of it, and at the edges."""
    for _ in range(3):
        bench.keep_running(velocity, 1.3, every=0.02)
        bench.keep_running("-0.2,0.3,-0.1", 0.7)
        bench.keep_running("0,0,0", 0.3)
        assert bench.status() in (Status.IDLE, Status.MOVING)
