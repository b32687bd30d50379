"""The emulated rig: the gantry's own firmware under simavr, a separate program with a serial port."""

import contextlib
import json
import os
import subprocess
import threading
import time
from pathlib import Path
from typing import Any, Self

from services.gantry.link import PortError, RigError
from services.gantry.protocol import Position

FOLDER = "DODO_FIRMWARE"
"""Environment variable: the folder that holds ``rig-emulator``, ``gantry.elf`` and ``gantry-circle.elf``."""

PLACES = (Path(__file__).resolve().parents[2] / "build" / "firmware", Path("/opt/dodo/firmware"))
START = "-0.89,-0.69,-150"
"""Where it stands at first (m, m, degrees): near its home, so that finding that is quick."""
CIRCLE = ("--kind", "circle", "--start", "-0.89,-0.69,-170")

MOST_PAUSED, MOST_PAUSED_SHARE = 0.25, 0.05
"""s for which it may stand still, as the machine keeps it waiting, and the share of a longer test; no real rig does.

The firmware brakes 500 ms after the last RUN, the gantry halts it 300 ms after the last position: less than both is as
if the serial line had been held up. What fails with any pause at all is not a verdict: see dodo_dsl.run.machine_load.
"""

_START_PATIENCE = 10.0
_HIGH_PRIORITY = -10
_LONGEST = 200


class EmulatedRig:
    """The program, started; ``port`` is its pseudo terminal. A context manager that ends it."""

    def __init__(self, folder: Path | None = None, kind: str | None = None) -> None:
        """``kind`` is circle or None. Raises PortError if programs are missing, RigError when they do not start."""
        options, firmware = (CIRCLE, "gantry-circle.elf") if kind else (("--start", START), "gantry.elf")
        folder = folder or _folder(firmware)
        self.port = ""
        self._true: Position | None = None
        self._fault = ""
        self._watched: float | None = None
        self._paused = 0.0
        self._ready = threading.Event()
        self._process = subprocess.Popen(
            [folder / "rig-emulator", *options, folder / firmware],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            process_group=0,  # it outlives a signal to the gantry's group, so that it gets the last STOP
        )
        _hurry(self._process.pid)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        if not self._ready.wait(_START_PATIENCE) or not self.port:
            self.close()
            raise RigError("the emulated rig did not start")

    def watch(self) -> None:
        """From now on it has to keep real time."""
        self._watched = time.monotonic()

    @property
    def paused(self) -> float:
        """Seconds for which it has stood still since ``watch``, in pauses of more than 50 ms."""
        return self._paused

    def position(self) -> Position | None:
        """Where the rig truly is by now, in its frame (m, rad); raises RigError when it was too late or has ended."""
        if self._process.poll() is not None:
            raise RigError(f"the emulated rig ended with exit code {self._process.returncode}")
        if self._fault:
            raise RigError(self._fault)
        return self._true

    def close(self) -> None:
        self._process.terminate()
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                try:
                    self._take(json.loads(line))
                except (ValueError, KeyError, TypeError, AttributeError):
                    text = line.decode(errors="replace").strip()[:_LONGEST]
                    self._fault = f"the emulated rig sent an unreadable line: {text}"
        self._ready.set()

    def _take(self, line: dict[str, Any]) -> None:
        if line.get("ready"):
            self.port = str(line["port"])
            self._ready.set()
        elif line.get("event") == "late" and self._watched is not None:
            self._pause(float(line["late"]), time.monotonic() - self._watched)
        elif "x" in line:
            self._true = Position(line["x"], line["y"], line["yaw"])

    def _pause(self, late: float, watched: float) -> None:
        """It was ``late`` s late, and goes on from there, ``watched`` s after the test began."""
        self._paused += late
        if self._paused > max(MOST_PAUSED, MOST_PAUSED_SHARE * watched) or late > MOST_PAUSED:
            self._fault = (
                f"the emulated rig could not keep real time: it stood still for {self._paused:.3f} s in {watched:.1f} s"
            )


def _hurry(process: int) -> None:
    """Ahead of other programs, as a rig waits for none; where this user may. It uses a tenth of a core."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process, _HIGH_PRIORITY)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_RR, os.sched_param(1))


def _folder(firmware: str) -> Path:
    named = os.environ.get(FOLDER)
    for folder in (Path(named),) if named else PLACES:
        if (folder / "rig-emulator").is_file() and (folder / firmware).is_file():
            return folder
    way = (
        f"build it in {FOLDER}, which is {named}"
        if named
        else f"'make firmware' in a checkout of DoDo, or set {FOLDER}"
    )
    raise PortError(f"the emulated rig is not built: {way}")
