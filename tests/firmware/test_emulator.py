"""The firmware's binary on the emulated rig: the port, the drivers, the true pose, faults."""

import json
import math
import os
import signal
import subprocess
import termios
import time
from pathlib import Path

import pytest
import serial

from services.gantry.rig_table import ACCELERATION, SPEED, Error, Status
from tests.firmware.programs import ELF, EMULATOR, Rig


def test_calibrate_goto_run_and_position(new_rig: Rig) -> None:
    assert new_rig.status() == Status.NOT_CALIBRATED
    new_rig.calibrate()
    assert new_rig.is_true()
    new_rig.go(0.3, -0.2, 1.2)
    assert new_rig.position()[:2] == pytest.approx((0.3, -0.2), abs=3e-6)
    assert new_rig.is_true()
    new_rig.keep_running("0.2,0.1,-0.3", 1)
    pose = new_rig.pose()
    assert (pose["vx"], pose["vy"], pose["vyaw"]) == pytest.approx((0.2, 0.1, -0.3), rel=0.05)
    new_rig.send_line("$STOP")
    new_rig.run(1)
    assert new_rig.is_true()
    extremes = new_rig.extremes()
    assert all(fast <= most for fast, most in zip(extremes["speed"], SPEED.values(), strict=True))
    assert all(ramp <= most for ramp, most in zip(extremes["ramp"], ACCELERATION.values(), strict=True))
    assert new_rig.events == [one for one in new_rig.events if one["event"] in ("reset", "closed", "open")]


def test_a_rig_that_differs_from_the_table(firmware: None) -> None:
    with Rig("--scale", "1.03,1,0.99", "--shift", "0.007,0,2") as rig:
        rig.open()
        rig.calibrate()
        rig.go(0.3, -0.2, 1)
        x, y, yaw = rig.position()
        pose = rig.pose()
        true = (1.03 * x + 0.007, y, 0.99 * yaw + math.radians(2))
        assert (pose["x"], pose["y"], pose["yaw"]) == pytest.approx(true, abs=3e-6)


@pytest.mark.parametrize(
    ("command", "status"),
    [
        ("push x 8", Status.STALL),
        ("switch y2 closed", Status.LIMIT),
        ("heat alpha warm", Status.HOT),
        ("heat y1 hot", Status.HOT),
        ("short x", Status.FAULT),
        ("motors off", Status.FAULT),
        ("cut spi", Status.FAULT),
        ("cut clock", Status.FAULT),
        ("cut data", Status.FAULT),
    ],
)
def test_faults_stop_the_rig_and_have_a_status(rig: Rig, command: str, status: Status) -> None:
    rig.keep_running("0.1,0.1,0.2", 0.4)
    rig.command(command)
    rig.run(0.02)
    assert rig.status() == status
    rig.run(0.6)
    assert not rig.pose()["moves"]
    assert rig.speed() < 1e-3


def test_opening_the_port_resets_the_controller_and_the_position_stays(rig: Rig) -> None:
    rig.close()
    rig.run(0.1)
    resets = len(rig.happened("reset"))
    rig.open()
    assert len(rig.happened("reset")) == resets + 1
    assert rig.status() == Status.IDLE
    assert rig.is_true()
    assert rig.send_line("$RUN:0.1,0,0") == [f"$ERROR:{int(Error.RESTARTED)}"]
    rig.send_line("$STOP")
    assert rig.send_line("$RUN:0.1,0,0") == []


def test_a_port_that_keeps_dtr_up_resets_nothing(rig: Rig) -> None:
    assert rig.port is not None
    attributes = termios.tcgetattr(rig.port.fileno())
    attributes[2] &= ~termios.HUPCL
    termios.tcsetattr(rig.port.fileno(), termios.TCSANOW, attributes)
    rig.close()
    rig.run(0.1)
    resets = len(rig.happened("reset"))
    rig.open()
    assert len(rig.happened("reset")) == resets
    assert rig.status() == Status.IDLE


def test_help_ends_with_an_example_that_runs(firmware: None, tmp_path: Path) -> None:
    text = subprocess.run([EMULATOR, "--help"], capture_output=True, text=True, check=True).stdout
    words = text.splitlines()[-1].removeprefix("example: ").split()
    assert words[0] == "rig-emulator" and words[-1] == "build/firmware/gantry.elf"
    link = tmp_path / "rig"
    process = subprocess.Popen(
        [EMULATOR, "--link", link, ELF], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdin is not None
    try:
        while "port" not in (line := process.stdout.readline()):
            assert line
        assert os.path.realpath(link) == json.loads(line)["port"]
        with serial.Serial(str(link), 115200, timeout=10) as port:
            answer = b""
            while not answer:
                port.write(b"$STATUS\n")
                time.sleep(0.02)
                answer = port.read(port.in_waiting)
        assert b"$6\n" in answer
    finally:
        process.stdin.close()  # which ends it
        process.stdout.close()
        assert process.wait(10) == 0
    assert not link.is_symlink()


def test_it_reports_that_it_was_late(firmware: None) -> None:
    process = subprocess.Popen([EMULATOR, ELF], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdin is not None
    try:
        while "x" not in (line := process.stdout.readline()):
            assert line
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.2)
        process.send_signal(signal.SIGCONT)
        while "late" not in (line := process.stdout.readline()):
            assert line
        assert json.loads(line)["late"] > 0.05
        assert json.loads(line)["total"] >= json.loads(line)["late"]
    finally:
        process.terminate()
        process.stdin.close()
        process.stdout.close()
        assert process.wait(10) == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "expected options"),
        (["--start", "here", str(ELF)], "expected options"),
        (["/dev/null"], "is not a firmware"),
        (["missing.elf"], "is not a firmware"),
        ([__file__], "is not a firmware"),
        (["--link", "/nowhere/rig", str(ELF)], "no link"),
    ],
)
def test_mistakes_are_reported_in_one_sentence(firmware: None, words: list[str], sentence: str) -> None:
    done = subprocess.run([EMULATOR, *words], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 2
    assert sentence in done.stderr and done.stderr.count("\n") == 1


def test_unknown_commands_are_answered(new_rig: Rig) -> None:
    for command in ("run -1", "run x", "switch z open", "heat x", "nothing", "motors perhaps"):
        with pytest.raises(AssertionError, match="error"):
            new_rig.command(command)
