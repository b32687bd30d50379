"""The emulated rig in real time as hardware that a test of DoDo can get at: its port, its orders, its true pose."""

import json
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Self

from services.gantry.emulated import START
from tests.drive.applications import ROOT

BUILT = ROOT / "build" / "firmware"


class Pose(NamedTuple):
    """When (s, the rig's time), where (m, m, rad) and how fast (m/s, m/s, rad/s) it truly is."""

    t: float
    x: float
    y: float
    yaw: float
    vx: float
    vy: float
    vyaw: float

    @property
    def speed(self) -> float:
        return max(abs(self.vx), abs(self.vy))


class Hardware:
    """The emulator with a port at ``path``; it lives until the end, whoever uses the port."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.poses: list[Pose] = []
        self.events: list[dict[str, Any]] = []
        words = [BUILT / "rig-emulator", "--start", START, "--link", path, BUILT / "gantry.elf"]
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdin is not None
        self.process.stdin.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                said = json.loads(line)
                if "x" in said:
                    self.poses.append(Pose(*(float(said[name]) for name in Pose._fields)))
                elif "event" in said:
                    self.events.append(said)

    def order(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    @property
    def late(self) -> bool:
        return any(event["event"] == "late" for event in self.events)

    def until(self, true: Callable[[Pose], bool], patience: float) -> Pose:
        """The first pose from now on for which something is true."""
        seen, end = len(self.poses), time.monotonic() + patience
        while time.monotonic() < end:
            for pose in self.poses[seen:]:
                if true(pose):
                    return pose
            seen = len(self.poses)
            time.sleep(0.01)
        raise AssertionError(f"the rig did not come to do it within {patience:g} s: {self.poses[-1:]}")
