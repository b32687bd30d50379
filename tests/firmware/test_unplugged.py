"""Ways of pulling the plug while the rig runs, in the emulated rig's own time."""

import itertools
import os
import signal
import subprocess
import sys
from collections.abc import Callable

import pytest

from services.gantry.rig_table import ACCELERATION, WATCHDOG, Status
from tests.firmware.programs import CIRCLE_ELF, Rig

VELOCITY = "0.3,0.2,0.4"
SEEN = 0.03
"""s in which a rig that brakes has visibly lost speed, and somebody looked."""
AT_ONCE = 0.1
"""s in which carriages without current come to rest."""
REST = max(0.3 / ACCELERATION["x"], 0.4 / ACCELERATION["yaw"] * 1.1)


def close_port(rig: Rig) -> None:
    rig.close()


def stay_silent(rig: Rig) -> None:
    """The host hangs with its port open."""


def only_garbage(rig: Rig) -> None:
    """The cable is broken and picks up noise."""
    assert rig.port is not None
    rig.port.write(b"\x00\xff$RU\x80N:0.3,0.2\n" * 40)


def pull_cable(rig: Rig) -> None:
    """The controller has a supply of its own."""
    rig.command("unplug")


def pull_cable_and_power(rig: Rig) -> None:
    rig.command("unplug power")


def hang(rig: Rig) -> None:
    rig.command("hang")


def hold_in_reset(rig: Rig) -> None:
    rig.command("hold on")


def motor_supply(rig: Rig) -> None:
    rig.command("motors off")


def open_again(rig: Rig) -> None:
    """Another program opens the port, which resets the controller."""
    rig.close()
    rig.run(0.02)
    rig.open()


def kill_client(rig: Rig) -> None:
    """The program that holds the port is killed."""
    rig.close()
    rig.run(0.02)
    hold = "import serial, sys, time\nport = serial.Serial(sys.argv[1], 115200)\nprint(flush=True)\ntime.sleep(60)"
    client = subprocess.Popen([sys.executable, "-c", hold, rig.path], stdout=subprocess.PIPE)
    assert client.stdout is not None
    client.stdout.readline()
    os.kill(client.pid, signal.SIGKILL)
    client.wait()
    client.stdout.close()


SILENT, SOON, START = (WATCHDOG, WATCHDOG), (0.0, 0.21), (0.0, 0.19)
BEGINS = {close_port: SILENT, stay_silent: SILENT, only_garbage: SILENT, pull_cable: SILENT}
BEGINS |= {kill_client: SILENT, hang: SOON, open_again: START}
"""s after the last RUN between which braking begins; 20 ms pass before the plug is pulled, and 170 ms with the port."""
ABRUPT = [pull_cable_and_power, hold_in_reset, motor_supply]


def speeds(rig: Rig, seconds: float) -> list[tuple[float, ...]]:
    found = []
    for _ in range(round(seconds / 0.01)):
        rig.run(0.01)
        pose = rig.pose()
        found.append((abs(pose["vx"]), abs(pose["vy"]), abs(pose["vyaw"])))
    return found


def braking_begins(rig: Rig, pull: Callable[[Rig], None]) -> float:
    """s after the last RUN until all axes have lost speed."""
    rig.send_line(f"$RUN:{VELOCITY}")
    begin, before = rig.pose()["t"] - 0.01, speeds(rig, 0.01)[0]
    pull(rig)
    while not all(now < then - 0.005 for now, then in zip(speeds(rig, 0.01)[0], before, strict=True)):
        assert rig.pose()["t"] < begin + 1, "braking has not begun"
    return float(rig.pose()["t"]) - begin


@pytest.mark.parametrize("pull", BEGINS, ids=lambda pull: pull.__name__)
def test_the_rig_brakes(rig: Rig, pull: Callable[[Rig], None]) -> None:
    rig.keep_running(VELOCITY, 1.2)
    rig.extremes()
    earliest, latest = BEGINS[pull]
    assert earliest <= braking_begins(rig, pull) <= latest + SEEN
    rest = speeds(rig, REST + 0.1)
    assert all(
        after <= earlier + 0.002
        for a, b in itertools.pairwise(rest)
        for earlier, after in zip(a[:2], b[:2], strict=True)
    )
    assert max(rest[-1]) < 0.005
    assert all(ramp <= most for ramp, most in zip(rig.extremes()["ramp"], ACCELERATION.values(), strict=True))
    assert rig.happened("slip") == [] and rig.happened("crash") == []


@pytest.mark.parametrize("pull", ABRUPT, ids=lambda pull: pull.__name__)
def test_the_rig_stops_at_once_without_power(rig: Rig, pull: Callable[[Rig], None]) -> None:
    rig.keep_running(VELOCITY, 1.2)
    pull(rig)
    assert max(speeds(rig, (0.25 if pull is hold_in_reset else 0) + AT_ONCE)[-1]) < 0.002
    assert rig.happened("crash") == []


@pytest.mark.parametrize("pull", [pull_cable, hang, pull_cable_and_power], ids=lambda pull: pull.__name__)
def test_a_yaw_that_turns_without_end_stops_past_its_index(firmware: None, pull: Callable[[Rig], None]) -> None:
    """Nothing ends its turn but the firmware, or the motors' current."""
    with Rig("--kind", "circle", place=(-0.85, -0.65, -178), elf=CIRCLE_ELF) as rig:
        rig.open()
        rig.calibrate()
        rig.go(-0.8, -0.6, 2.6)
        rig.keep_running("0,0,0.8", 1)
        pull(rig)
        rig.run(0.05)
        assert (rig.pose()["vyaw"] > 0.7) == (pull is not pull_cable_and_power)
        rig.run(WATCHDOG + SEEN + 0.8 / ACCELERATION["yaw"] * 1.1)
        assert not rig.pose()["moves"] and abs(rig.pose()["vyaw"]) < 0.005
        assert rig.happened("slip") == [] or pull is pull_cable_and_power


def test_after_the_cable_alone_it_goes_on_where_it_was(rig: Rig) -> None:
    rig.keep_running(VELOCITY, 1)
    rig.command("unplug")
    rig.close()
    rig.run(2)
    rig.plug()
    rig.open()
    assert rig.status() == Status.IDLE
    assert rig.is_true()


def test_after_a_loss_of_power_it_asks_for_calibrate(rig: Rig) -> None:
    rig.keep_running(VELOCITY, 1)
    rig.command("unplug power")
    rig.close()
    rig.run(2)
    rig.plug()
    rig.open()
    assert rig.status() == Status.NOT_CALIBRATED
    rig.calibrate()
    assert rig.is_true()
