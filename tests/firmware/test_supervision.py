"""Faults that drivers report, and how the firmware's core reacts."""

import pytest

from services.gantry.rig_table import Status
from tests.firmware.programs import Bench

MOTORS = ("x", "y1", "y2", "alpha")


@pytest.mark.thorough
@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize(
    ("command", "status", "void"),
    [
        ("heat {} warm", Status.HOT, False),
        ("heat {} hot", Status.HOT, True),
        ("short {}", Status.FAULT, True),
        ("push {} 8", Status.STALL, True),
    ],
)
def test_trouble_stops_everything(bench: Bench, motor: str, command: str, status: Status, void: bool) -> None:
    bench.keep_running("0.1,0.1,0.2", 0.5)
    bench.command(command.format(motor))
    bench.run(0.01)
    assert bench.status() == status
    bench.run(1)
    assert not bench.pose()["moves"]
    assert bench.send_line("$POSITION")[0].startswith("$ERROR") == void
    bench.command(f"heat {motor} cool")
    bench.send_line("$STOP")
    assert bench.status() == (Status.NOT_CALIBRATED if void else Status.IDLE)
    assert abs(bench.pose()["skew"]) < 0.012


def test_a_pair_whose_counters_part_stops_and_is_void(bench: Bench) -> None:
    bench.keep_running("0,0.1,0", 0.5)
    bench.command("miscount y2 8")
    bench.run(0.01)
    assert bench.status() == Status.FAULT
    bench.run(0.1)
    assert not bench.pose()["moves"]
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


def test_motors_without_supply_are_a_fault_until_they_have_it_and_are_calibrated(bench: Bench) -> None:
    bench.keep_running("0.2,0.1,0", 0.5)
    bench.command("motors off")
    bench.run(0.3)
    assert bench.status() == Status.FAULT
    assert bench.speed() < 1e-3
    bench.send_line("$CALIBRATE")
    bench.run(0.1)
    assert bench.status() == Status.FAULT
    bench.command("motors on")
    bench.send_line("$STOP")
    bench.run(0.01)
    assert bench.status() == Status.NOT_CALIBRATED
    bench.calibrate()
    bench.go(0.1, 0.1, 0.1)
    assert bench.is_true()


def test_a_hard_stop_from_high_speed_voids_the_position(bench: Bench) -> None:
    """The motor slips, as the switch stops it harder than it can hold."""
    bench.keep_running("0.6,0,0", 1.3)
    bench.command("switch x closed")
    bench.run(0.5)
    assert bench.status() == Status.LIMIT
    assert bench.happened("slip")
    bench.command("switch x works")
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.thorough
@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("command", ["heat {} hot", "short {}", "push {} 8", "forget {}"])
def test_stop_does_not_hide_what_voids_the_position(bench: Bench, motor: str, command: str) -> None:
    """STOP takes back the flags before the firmware has looked at them."""
    bench.command(command.format(motor))
    bench.command(f"heat {motor} cool")
    if command.startswith("push"):
        bench.command("pass 0.0005")
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED


@pytest.mark.parametrize("wire", ["spi", "clock", "data"])
@pytest.mark.parametrize("line", ["$RUN:0.3,0.2,0.4", "$GOTO:0.9,0.7,2.9", "$CALIBRATE"])
@pytest.mark.thorough
def test_drivers_that_cannot_be_reached_lose_their_current(bench: Bench, wire: str, line: str) -> None:
    for _ in range(15):
        bench.send_line(line)
        bench.run(0.05)
    bench.command(f"cut {wire}")
    bench.run(0.02)
    assert bench.status() == Status.FAULT
    bench.run(0.15)
    pose = bench.pose()
    assert not pose["moves"]
    assert abs(pose["vx"]) + abs(pose["vy"]) + abs(pose["vyaw"]) < 1e-3
    for attempt in ("$STOP", "$CALIBRATE", line):
        bench.send_line(attempt)
        bench.run(0.1)
        assert bench.status() == Status.FAULT
    assert not bench.pose()["moves"]
    bench.command("cut nothing")
    bench.run(0.1)
    assert bench.status() == Status.FAULT
    bench.send_line("$STOP")
    assert bench.status() == Status.NOT_CALIBRATED
    bench.calibrate()
    bench.go(0.1, 0.1, 0.1)
    assert bench.is_true()
