"""Silence during RUN."""

import pytest

from services.gantry.table import WATCHDOG, Error, Status
from tests.firmware.programs import Bench


def test_silence_begins_braking_after_500_ms(bench: Bench) -> None:
    bench.keep_running("0.3,0,0", 1)
    bench.say("$RUN:0.3,0,0")
    bench.run(WATCHDOG - 0.01)
    assert bench.pose()["vx"] == pytest.approx(0.3, rel=0.02)
    bench.run(0.06)
    assert 0.2 < bench.pose()["vx"] < 0.29
    assert bench.status() == Status.WATCHDOG
    bench.run(0.3 / 0.5)
    assert not bench.pose()["moves"]
    assert bench.extremes()["ramp"][0] <= 0.5


@pytest.mark.parametrize("velocity", ["0,0.2,0", "0,0,0.4", "-0.2,0,0"])
def test_silence_brakes_every_axis(bench: Bench, velocity: str) -> None:
    bench.keep_running(velocity, 0.6)
    bench.run(1.5)
    assert not bench.pose()["moves"]
    assert bench.status() == Status.WATCHDOG


def test_each_run_counts_anew(bench: Bench) -> None:
    bench.keep_running("0.1,0,0", 3, every=0.45)
    assert bench.status() == Status.MOVING


@pytest.mark.parametrize("line", ["$STATUS", "$POSITION", "$RUN:2,0,0", "$RUN", "$NOISE"])
def test_only_a_valid_run_keeps_it_alive(bench: Bench, line: str) -> None:
    bench.keep_running("0.1,0,0", 0.3)
    for _ in range(12):
        bench.say(line)
        bench.run(0.05)
    assert bench.status() == Status.WATCHDOG


def test_run_waits_for_stop_afterwards(bench: Bench) -> None:
    bench.keep_running("0.1,0,0", 0.3)
    bench.run(1)
    assert bench.say("$RUN:0.1,0,0") == [f"$ERROR:{int(Error.TROUBLE)}"]
    bench.run(0.2)
    assert not bench.pose()["moves"]
    bench.say("$STOP")
    assert bench.status() == Status.IDLE
    assert bench.say("$RUN:0.1,0,0") == []


def test_goto_acknowledges_it(bench: Bench) -> None:
    bench.keep_running("0.1,0,0", 0.3)
    bench.run(1)
    bench.go(0.2, 0.2, 0)
    assert bench.status() == Status.IDLE


def test_goto_needs_nobody(bench: Bench) -> None:
    bench.say("$GOTO:0.5,0,0")
    bench.run(5)
    assert bench.status() == Status.IDLE
