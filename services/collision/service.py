"""The judge on the bus."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from services.base import Context, Flags, Handler, Output, Service
from services.collision.geometry import Box, Pose, heading_of
from services.collision.model import REQUESTS, Judge
from services.collision.obstacles import load, pick
from services.collision.track import Track

PERIOD = 10_000  # us


class Collision(Service):
    """Takes the vehicle's frames under the sender stamp ``frame-id`` and the application's requests of any."""

    period = PERIOD

    def __init__(self, context: Context) -> None:
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
        return ()

    def end_of_input(self, now: int) -> None:
        self.judge.end(now)
        self.verdict = self.judge.verdict

    def _request(self, name: str) -> Handler:
        return lambda _message, _sample_time: self.judge.request(name)

    def _look(self, frame: Any, sample_time: int) -> None:
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
