"""Silence during RUN."""

import pytest

from services.gantry.rig_table import WATCHDOG, Error, Status
from tests.firmware.programs import Bench


def test_silence_begins_braking_after_500_ms(bench: Bench) -> None:
    bench.keep_running("0.3,0,0", 1)
    bench.send_line("$RUN:0.3,0,0")
    bench.run(WATCHDOG - 0.01)
    assert bench.pose()["vx"] == pytest.approx(0.3, rel=0.02)
    bench.run(0.06)
    assert 0.2 < bench.pose()["vx"] < 0.29
    assert bench.status() == Status.WATCHDOG
    bench.run(0.3 / 0.5)
    assert not bench.pose()["moves"]
    assert bench.extremes()["ramp"][0] <= 0.5


def test_each_run_counts_anew(bench: Bench) -> None:
    bench.keep_running("0.1,0,0", 3, every=0.45)
    assert bench.status() == Status.MOVING


@pytest.mark.parametrize("line", ["$STATUS", "$POSITION", "$RUN:2,0,0", "$RUN", "$NOISE"])
def test_only_a_valid_run_keeps_it_alive(bench: Bench, line: str) -> None:
    bench.keep_running("0.1,0,0", 0.3)
    for _ in range(12):
        bench.send_line(line)
        bench.run(0.05)
    assert bench.status() == Status.WATCHDOG


def test_run_waits_for_stop_afterwards(bench: Bench) -> None:
    bench.keep_running("0.1,0,0", 0.3)
    bench.run(1)
    assert bench.send_line("$RUN:0.1,0,0") == [f"$ERROR:{int(Error.TROUBLE)}"]
    bench.run(0.2)
    assert not bench.pose()["moves"]
    bench.send_line("$STOP")
    assert bench.status() == Status.IDLE
    assert bench.send_line("$RUN:0.1,0,0") == []


@pytest.mark.parametrize("line", ["$GOTO:0.9,0.7,2.9", "$CALIBRATE"])
@pytest.mark.thorough
def test_goto_and_calibrate_brake_when_nobody_is_there(bench: Bench, line: str) -> None:
    bench.send_line(line)
    bench.watch(0.6)
    bench.run(WATCHDOG - 0.01)
    before = abs(bench.pose()["vx"])
    bench.run(0.06)
    assert abs(bench.pose()["vx"]) < before - 0.01
    assert bench.status() == Status.WATCHDOG
    bench.run(2)
    assert not bench.pose()["moves"]
    assert max(bench.extremes()["ramp"][:2]) <= 0.5
    bench.send_line("$STOP")
    assert bench.status() == (Status.IDLE if "GOTO" in line else Status.NOT_CALIBRATED)


@pytest.mark.thorough
def test_goto_brakes_when_nobody_is_there_before_it_sets_off(bench: Bench) -> None:
    bench.keep_running("0.8,0,0", 1.6)
    bench.send_line("$GOTO:-0.5,0,0")
    bench.run(WATCHDOG + 0.01)
    assert bench.status() == Status.WATCHDOG
    assert bench.pose()["moves"]
    bench.run(3)
    assert bench.position()[0] > 0.5


@pytest.mark.parametrize("line", ["$STATUS", "$POSITION"])
def test_goto_goes_on_while_somebody_asks(bench: Bench, line: str) -> None:
    bench.send_line("$GOTO:0.5,0,0")
    for _ in range(12):
        bench.run(WATCHDOG - 0.02)
        bench.send_line(line)
    assert bench.status() == Status.IDLE
    assert bench.position()[0] == pytest.approx(0.5, abs=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("line", ["$GOTO:2,0,0", "$NOISE", "$RUN:1", "STATUS", ""])
@pytest.mark.parametrize("motion", ["$GOTO:0.7,0.5,2", "$CALIBRATE"])
def test_a_line_with_a_mistake_is_nobody(bench: Bench, motion: str, line: str) -> None:
    bench.send_line(motion)
    for _ in range(12):
        bench.run(0.05)
        bench.send_line(line)
    assert bench.status() == Status.WATCHDOG


WRAPS = [0.02, 0.25, 0.49]
"""s after the last line in which the clock of milliseconds wraps."""


@pytest.mark.parametrize("wraps", WRAPS)
def test_silence_is_noticed_in_time_while_the_clock_wraps(bench: Bench, wraps: float) -> None:
    bench.command(f"wraps {1.0 + wraps}")
    bench.keep_running("0.3,0,0", 1)
    bench.command(f"wraps {wraps}")
    bench.send_line("$RUN:0.3,0,0")
    bench.run(WATCHDOG - 0.01)
    assert bench.status() == Status.MOVING
    assert bench.pose()["vx"] == pytest.approx(0.3, rel=0.02)
    bench.run(0.03)
    assert bench.status() == Status.WATCHDOG
    assert bench.pose()["vx"] < 0.295


@pytest.mark.slow
@pytest.mark.parametrize("wraps", WRAPS)
def test_goto_is_watched_while_the_clock_wraps(bench: Bench, wraps: float) -> None:
    bench.command(f"wraps {wraps}")
    bench.send_line("$GOTO:0.9,0,0")
    bench.run(WATCHDOG - 0.02)
    assert bench.status() == Status.MOVING
    bench.command(f"wraps {wraps}")
    bench.send_line("$STATUS")
    bench.run(WATCHDOG + 0.02)
    assert bench.status() == Status.WATCHDOG
