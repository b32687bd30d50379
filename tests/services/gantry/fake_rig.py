"""A rig on a pseudo terminal that obeys the protocol and moves, in a thread; it can misbehave.

What it cannot do (accelerate, reset, lose power) is tested on the emulated rig.
"""

import math
import os
import pty
import re
import select
import threading
import time
import tty
from pathlib import Path

from services.gantry.rig_table import CIRCLE_YAW, LIMITS, SPEED, Error

COMMAND = re.compile(r"\$([A-Z]+):?([-+0-9.,]*)")
WATCHDOG = 0.5
TICK = 0.004
QUICK = (8.0, 8.0, 40.0)
HOME, HOMING = (-0.9, -0.7, -2.63385), (0.1, 0.1, 0.35)
LEAST_HOMING = 0.1
TROUBLE = (3, 4, 5, 7, 8)


class FakeRig:
    """`path` is a link to its port; `plug` and `unplug` are the cable."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.at = [0.1, -0.1, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.status = 0
        """What it answers to STATUS; a fault is latched until STOP or CALIBRATE acknowledge it."""
        self.restarted: int | None = None
        """The error's code with which it answers RUN until STOP, as after a reset."""
        self.turn = False
        """Whether its turn is without end."""
        self.memory = [widest for _, widest in LIMITS.values()]
        """The limits that it keeps."""
        self.source = 0
        """Where they are from."""
        self.forgetful = False
        """Whether its memory takes no limits."""
        self.calibrated = True
        self.silent = False
        self.homes_slowly = False
        self.received: list[tuple[str, tuple[float, ...]]] = []
        self._goal: list[float] | None = None
        self._home_at = 0.0
        self._last_run = 0.0
        self._rest = b""
        self._master: int | None = None
        self._lock = threading.RLock()
        self._over = False
        self.plug()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def __enter__(self) -> "FakeRig":
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self._thread.join()
        self.unplug()

    def plug(self) -> None:
        with self._lock:
            self._master, slave = pty.openpty()
            tty.setraw(slave)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(slave))
            os.close(slave)

    def unplug(self) -> None:
        with self._lock:
            self.path.unlink(missing_ok=True)
            if self._master is not None:
                os.close(self._master)
            self._master = None
            self.velocity = [0.0, 0.0, 0.0]

    def commands(self, word: str) -> list[tuple[float, ...]]:
        return [arguments for name, arguments in list(self.received) if name == word]

    def last(self) -> str:
        """The last command that moves or stops."""
        return [name for name, _ in list(self.received) if name in ("RUN", "STOP", "GOTO", "CALIBRATE")][-1]

    def _live(self) -> None:
        before = time.monotonic()
        while not self._over:
            with self._lock:
                self._listen()
                now = time.monotonic()
                self._move(now - before, now)
                before = now
            time.sleep(TICK)

    def _listen(self) -> None:
        if self._master is None or not select.select([self._master], [], [], 0)[0]:
            return
        try:
            data = os.read(self._master, 4096)
        except OSError:  # nobody holds the other end
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._obey(line.decode())

    def _obey(self, line: str) -> None:
        match = COMMAND.fullmatch(line)
        assert match is not None, line
        word, arguments = match[1], tuple(float(a) for a in match[2].split(",") if a)
        self.received.append((word, arguments))
        error = self._refusal(word, arguments)
        if error is not None:
            self._answer(f"ERROR:{int(error)}")
        elif word == "RUN":
            self.velocity, self._last_run = list(arguments), time.monotonic()
        elif word == "STOP":
            self.velocity, self._goal, self.restarted = [0.0, 0.0, 0.0], None, None
            self._acknowledge()
        elif word == "LIMITS":
            self._answer_limits()
        elif word == "SETLIMITS" and not self.forgetful:
            self.memory, self.source = list(arguments), 1
        elif word == "FORGET":
            self.calibrated = False
        elif word == "GOTO":
            self._acknowledge()
            self._goal = list(arguments)
        elif word == "CALIBRATE":
            self._acknowledge()
            self._home()
        elif word == "POSITION":
            self._answer(",".join(f"{value:.5f}" for value in self.at))
        elif word == "STATUS":
            self._answer(str(self._said()))

    def _refusal(self, word: str, arguments: tuple[float, ...]) -> int | None:
        if word == "SETLIMITS" and self.calibrated:
            return Error.BUSY
        homing = time.monotonic() < self._home_at
        if word == "POSITION" and (homing or not self.calibrated):
            return Error.UNCALIBRATED
        if homing and word in ("RUN", "GOTO", "CALIBRATE"):
            return Error.HOMING
        if word not in ("RUN", "GOTO"):
            return None
        if self.status in TROUBLE and not (word == "GOTO" and self.status == 7):
            return Error.TROUBLE
        if word == "RUN" and self.restarted:
            return self.restarted
        too_fast = word == "RUN" and any(abs(a) > s for a, s in zip(arguments, SPEED.values(), strict=True))
        return None if self.calibrated and not too_fast else Error.BOUNDS if too_fast else Error.UNCALIBRATED

    def _answer_limits(self) -> None:
        limits = dict(zip(LIMITS, self.memory, strict=True))
        limits |= {"yaw": CIRCLE_YAW} if self.turn else {}
        self._answer("LIMITS:" + ",".join(f"{limit:.6f}" for limit in limits.values()) + f",{self.source}")

    def _acknowledge(self) -> None:
        self.status = 0 if self.status in TROUBLE else self.status

    def _home(self) -> None:
        ways = [abs(a - h) for a, h in zip(self.at, HOME, strict=True)]
        took = max(way / speed for way, speed in zip(ways, HOMING, strict=True))
        self._home_at = time.monotonic() + max(LEAST_HOMING, took * self.homes_slowly)
        self.calibrated, self.at = True, list(HOME)

    def _said(self) -> int:
        if time.monotonic() < self._home_at:
            return 2
        if self.status or not self.calibrated:
            return self.status or 6
        return int(any(self.velocity) or self._goal is not None)

    def _answer(self, text: str) -> None:
        if self.silent or self._master is None:
            return
        os.write(self._master, f"${text}\n".encode())

    def _move(self, dt: float, now: float) -> None:
        if any(self.velocity) and now - self._last_run > WATCHDOG:
            self.status = 7
        if self.status in TROUBLE:
            self.velocity, self._goal = [0.0, 0.0, 0.0], None
        self.at = [a + v * dt for a, v in zip(self.at, self.velocity, strict=True)]
        if self._goal is not None:
            way = [goal - a for a, goal in zip(self.at, self._goal, strict=True)]
            if all(abs(w) <= q * dt for w, q in zip(way, QUICK, strict=True)):
                self.at, self._goal = self._goal, None
            else:
                self.at = [
                    a + math.copysign(min(abs(w), q * dt), w) for a, w, q in zip(self.at, way, QUICK, strict=True)
                ]
