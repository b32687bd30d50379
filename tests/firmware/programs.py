"""The programs that the tests of the firmware drive: its core on this machine, and the emulated rig with its binary."""

import fcntl
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import serial

from services.gantry.rig_table import MICROSTEP, Status

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "build" / "firmware"
ELF, CIRCLE_ELF = BUILT / "gantry.elf", BUILT / "gantry-circle.elf"
EMULATOR = BUILT / "rig-emulator"
MIDDLE = (0.1, -0.1, 11.0)
"""Where rigs stand at first; m, m, degrees."""


NEAR_HOME = (-0.85, -0.65, -140.0)


def make(*targets: str) -> None:
    """Builds targets of the firmware's Makefile; test processes side by side do so one after the other."""
    BUILT.mkdir(parents=True, exist_ok=True)
    with (BUILT / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["make", "-s", "-C", str(ROOT / "firmware"), *targets]
        made = subprocess.run(words, check=False, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr


class Program:
    """A program that takes commands, a line each, and answers in JSON; time passes only by `run`."""

    def __init__(self, *words: str) -> None:
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.events: list[dict[str, Any]] = []
        self.sent = 0
        """Bytes that the controller sent, all together."""

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        assert self._process.wait(10) == 0, "the program ended with an error"

    def read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the program ended"
        found: dict[str, Any] = json.loads(line)
        if "event" in found:
            self.events.append(found)
        return found

    def command(self, line: str) -> list[dict[str, Any]]:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        found: list[dict[str, Any]] = []
        while not found or not {"done", "error"} & found[-1].keys():
            found.append(self.read())
        assert found[-1].get("done") is True, f"{line}: {found[-1]}"
        self.sent = int(found[-1].get("sent", 0))
        return found[:-1]

    def run(self, seconds: float) -> list[dict[str, Any]]:
        return self.command(f"run {seconds:.4f}")

    def send_line(self, line: str) -> list[str]:
        """The answers to a line."""
        return self.send((line + "\n").encode("ascii"))

    def send(self, data: bytes) -> list[str]:
        raise NotImplementedError

    def ask(self, line: str) -> str:
        [answer] = self.send_line(line)
        return answer

    def status(self) -> Status:
        return Status(int(self.ask("$STATUS").removeprefix("$")))

    def position(self) -> tuple[float, ...]:
        return tuple(map(float, self.ask("$POSITION").removeprefix("$").split(",")))

    def pose(self) -> dict[str, Any]:
        [pose] = [one for one in self.command("pose") if "x" in one]
        return pose

    def extremes(self) -> dict[str, list[float]]:
        [found] = [one for one in self.command("extremes") if "way" in one]
        return found

    def happened(self, event: str) -> list[dict[str, Any]]:
        return [one for one in self.events if one["event"] == event]

    def until(self, wanted: Status, patience: float = 60.0, every: float = 0.25) -> float:
        """Let time pass until the rig has a status; the seconds."""
        passed = 0.0
        while (status := self.status()) != wanted:
            assert passed < patience, f"the rig reports {status.name} after {passed} s instead of {wanted.name}"
            self.run(every)
            passed += every
        return passed

    def calibrate(self) -> None:
        assert self.send_line("$CALIBRATE") == []
        self.until(Status.IDLE)

    def go(self, x: float, y: float, yaw: float) -> None:
        assert self.send_line(f"$GOTO:{x:.6f},{y:.6f},{yaw:.6f}") == []
        self.until(Status.IDLE)
        self.run(0.2)  # the rotor comes to rest

    def keep_running(self, velocity: str, seconds: float, every: float = 0.05) -> None:
        """RUN again and again."""
        for _ in range(round(seconds / every)):
            assert self.send_line(f"$RUN:{velocity}") == []
            self.run(every)

    def watch(self, seconds: float, every: float = 0.2) -> None:
        """Let time pass, and ask for the status meanwhile, as a master does."""
        for _ in range(round(seconds / every)):
            self.run(every)
            self.status()

    def is_true(self, microsteps: float = 1.0) -> bool:
        """Whether the measured position is the true one; a heading may have the name of another turn."""
        pose, measured = self.pose(), self.position()
        off = {axis: abs(pose[axis] - m) for axis, m in zip(MICROSTEP, measured, strict=True)}
        off["yaw"] = min(off["yaw"], abs(2 * math.pi - off["yaw"]))
        return all(off[axis] <= microsteps * step for axis, step in MICROSTEP.items())

    def speed(self) -> float:
        """True speed over the ground."""
        pose = self.pose()
        return math.hypot(pose["vx"], pose["vy"])


class Bench(Program):
    """The firmware's core, compiled for this machine with sanitizers."""

    def __init__(self, program: Path, place: tuple[float, float, float] = MIDDLE) -> None:
        super().__init__(str(program), str(place[0]), str(place[1]), str(math.radians(place[2])))

    def send(self, data: bytes) -> list[str]:
        return [one["answer"] for one in self.command("send " + data.hex()) if "answer" in one]


class Rig(Program):
    """The emulated rig: the firmware's binary behind a serial port."""

    def __init__(self, *options: str, place: tuple[float, float, float] = NEAR_HOME, elf: Path = ELF) -> None:
        where = ",".join(map(str, place))
        super().__init__(str(EMULATOR), "--stepped", "--start", where, *options, str(elf))
        self.path = self._ready()
        self.port: serial.Serial | None = None
        self._rest, self._got = b"", 0

    def __exit__(self, *details: object) -> None:
        self.close()
        super().__exit__(*details)

    def _ready(self) -> str:
        while "port" not in (found := self.read()):
            pass
        return str(found["port"])

    def open(self) -> None:
        """Open the port, which resets the controller, and wait until it can hear."""
        self.port = serial.Serial(self.path, 115200, timeout=5)
        self._rest, self._got = b"", self.sent
        self.run(0.15)

    def close(self) -> None:
        if self.port is not None:
            self.port.close()
        self.port = None

    def plug(self) -> None:
        [ready] = [one for one in self.command("plug") if "port" in one]
        self.path = ready["port"]

    def send(self, data: bytes) -> list[str]:
        """The answers that come within 10 ms after the last byte, in the controller's time."""
        assert self.port is not None
        self.port.write(data)
        self.command(f"await {len(data)}")
        self.run(0.01 + len(data) * 10 / 115200)
        new = self.port.read(self.sent - self._got)
        assert len(new) == self.sent - self._got, "answers are missing"
        self._got = self.sent
        *lines, self._rest = (self._rest + new).split(b"\n")
        return [line.decode("ascii") for line in lines]
