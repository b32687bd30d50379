"""The emulated rig: the gantry's own firmware under simavr, a separate program with a serial port."""

import contextlib
import json
import os
import subprocess
import threading
from pathlib import Path
from typing import Any, Self

from services.gantry.link import RigError
from services.gantry.port import PortError
from services.gantry.protocol import Position

FOLDER = "DODO_FIRMWARE"
"""Environment variable: the folder that holds ``rig-emulator`` and ``gantry.elf``."""

PLACES = (Path(__file__).resolve().parents[2] / "build" / "firmware", Path("/opt/dodo/firmware"))
START = "-0.89,-0.69,-150"
"""Where it stands at first (m, m, degrees): near its home, so that finding that is quick."""

_START_PATIENCE = 10.0
_HIGH_PRIORITY = -10
_LONGEST = 200


class EmulatedRig:
    """The program, started; ``port`` is its pseudo terminal. A context manager that ends it."""

    def __init__(self, folder: Path | None = None) -> None:
        """Raises PortError where the programs are not built, RigError when they do not start."""
        folder = folder or _folder()
        self.port = ""
        self._true: Position | None = None
        self._fault = ""
        self._watched = False
        self._ready = threading.Event()
        self._process = subprocess.Popen(
            [folder / "rig-emulator", "--start", START, folder / "gantry.elf"],
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
        self._watched = True

    def position(self) -> Position | None:
        """Where the rig truly is by now, in its frame (m, rad); raises RigError when it was late or has ended."""
        if self._process.poll() is not None:
            raise RigError(f"the emulated rig ended with exit code {self._process.returncode}")
        if self._fault:
            raise RigError(self._fault)
        return self._true

    def close(self) -> None:
        """End the program."""
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
        """The thread that reads the program's output up to its end."""
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
        elif line.get("event") == "late" and self._watched:
            self._fault = f"the emulated rig could not keep real time: it was {line['late']:.3f} s late"
        elif "x" in line:
            self._true = Position(line["x"], line["y"], line["yaw"])


def _hurry(process: int) -> None:
    """Ahead of other programs, as a rig waits for none; where this user may. It uses a tenth of a core."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process, _HIGH_PRIORITY)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_RR, os.sched_param(1))


def _folder() -> Path:
    named = os.environ.get(FOLDER)
    for folder in (Path(named),) if named else PLACES:
        if (folder / "rig-emulator").is_file() and (folder / "gantry.elf").is_file():
            return folder
    raise PortError(
        f"the emulated rig is not built: `make firmware` builds it in DoDo's checkout, or set {FOLDER} to its folder"
    )
