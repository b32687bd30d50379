"""The judge on the bus."""

import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from services.base import Context, Flags, Handler, Output, Service
from services.collision.geometry import Box, Pose, heading_of
from services.collision.model import REQUESTS, Judge, UnjudgeableError
from services.collision.obstacles import load, pick
from services.collision.track import Track

PERIOD = 10_000  # us
SILENCE, GAPS = 2.0, 3.0
"""s without a frame, and how often the longest time between two of them, after which whoever sent them hangs."""


class Collision(Service):
    """Takes the vehicle's frames under the sender stamp ``frame-id`` and the application's requests of any."""

    period = PERIOD

    def __init__(self, context: Context, wall: Callable[[], float] = time.monotonic) -> None:
        """``wall`` in s: on a rig it is an error when the vehicle vanishes."""
        self._wall = wall
        self._on_rig = context.on_rig
        self._seen: float | None = None
        self._gap = math.inf
        self._log = context.log
        flags = context.flags
        self.judge = Judge(track(flags), Box(flags["length"], flags["width"]))
        self.rejected = 0
        self.inputs = {("opendlv.sim.Frame", flags["frame-id"]): self._look}
        for name in REQUESTS:
            self.inputs[f"opendlv.proxy.{name}", None] = self._request(name)

    def begin(self, now: int) -> None:
        self.judge.begin(now)

    def update(self, now: int) -> Iterable[Message | Output]:
        self.judge.update(now)
        self.verdict = self.judge.verdict
        if self.verdict is None and self._on_rig and self._seen is not None:
            self._miss(self._wall() - self._seen)
        return ()

    def _miss(self, silent: float) -> None:
        """Raises UnjudgeableError when frames that came have stopped: the application is not to blame for that."""
        if silent > max(SILENCE, GAPS * self._gap):
            raise UnjudgeableError(f"no Frame of the vehicle has come for {silent:.0f} s, and they came before")

    def end_of_input(self, now: int) -> None:
        self.judge.end(now)
        self.verdict = self.judge.verdict

    def _request(self, name: str) -> Handler:
        return lambda _message, _sample_time: self.judge.request(name)

    def _look(self, frame: Any, sample_time: int) -> None:
        now = self._wall()
        if self._seen is not None:
            longest = 0.0 if math.isinf(self._gap) else self._gap
            self._gap = max(longest, now - self._seen)
        self._seen = now
        heading = heading_of(frame.qx, frame.qy, frame.qz, frame.qw)
        if heading is None or not math.isfinite(frame.x + frame.y):
            self.rejected += 1
            if self.rejected == 1:
                self._log.warning("a Frame without a place or an attitude is ignored, as all such will be")
            return
        self.judge.look(Pose(frame.x, frame.y, heading), sample_time)
        self.verdict = self.judge.verdict


def track(flags: Flags) -> Track:
    """The obstacles that the flags name, from the map; raises MapError, and ValueError for what makes no track."""
    path, goal, walls, gates = Path(flags["map-path"]), flags["goal"], flags["walls"], flags["gates"]
    if not goal and not walls and not gates:
        raise ValueError("there is nothing to judge by: give --goal, --gates or --walls")
    if goal in walls:
        raise ValueError(f"--goal={goal} is one of the --walls too")
    for name in gates:
        if name in walls:
            raise ValueError(f"{name} of --gates is one of the --walls too")
    if flags["min-margin"] and not walls:
        raise ValueError("--min-margin is a distance to --walls, of which there are none")
    obstacles = load(path)
    picked = pick(obstacles, gates, "gates", path)
    return Track(
        walls=pick(obstacles, walls, "walls", path),
        goal=pick(obstacles, [goal] if goal else [], "goal", path),
        max_time=flags["max-time"],
        gates=tuple((name, picked[name]) for name in gates),
        min_margin=flags["min-margin"],
    )


def build(context: Context) -> Service:
    """The service from its flags."""
    return Collision(context)
