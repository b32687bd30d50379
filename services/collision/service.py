"""The evaluator of a closed loop on the bus."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.assets.map_file import NO_BODIES
from dodo_dsl.opendlv.assets.track import VehicleBox, track
from dodo_dsl.opendlv.numbers import is_whole, whole
from services.base import Context, Flags, Handler, UnjudgeableError
from services.base.vehicle_pose import vehicle_pose
from services.collision.bodies import Footprints, load_footprints
from services.collision.model import Requests, TrackEvaluator

FRAME = "opendlv.sim.Frame"
SILENCE, GAPS = 2.0, 3.0
"""s without a frame, and how often the longest time between two of them, after which their sender hangs."""


class Collision(TrackEvaluator):
    """Takes the vehicle's frames under the sender stamp ``frame-id`` and the application's ``requests``."""

    def __init__(self, context: Context, wall: Callable[[], float] = time.monotonic) -> None:
        """``wall`` in s: on a rig it is an error when the vehicle vanishes."""
        flags = context.flags
        requests = {text: _port(text, context) for text in flags["requests"]}
        box = VehicleBox(flags["length"], flags["width"])
        bodies = _bodies(flags)
        super().__init__(track(flags), box, Requests(tuple(requests), flags["max-silence"]), bodies)
        self._on_rig, self._wall = context.on_rig, wall
        self._seen: float | None = None
        self._gap: float | None = None
        self.inputs = {(FRAME, stamp): partial(self._take_body, stamp) for stamp in bodies}
        self.inputs[FRAME, flags["frame-id"]] = self._take_frame
        for text, (name, stamp) in requests.items():
            self.inputs[name, stamp] = self._request(text)
            self.judged.message(name, stamp)
        roles = {**dict.fromkeys(self.track.walls, "wall"), **dict.fromkeys(flags["gates"], "gate")}
        roles |= {flags["goal"]: "goal"} if flags["goal"] else {}
        self.judged.way(flags["frame-id"], box.length, box.width, roles)

    def advance(self, now: int) -> None:
        super().advance(now)
        if self._on_rig and self._seen is not None and not self.is_overdue(now):
            self._check_silence(self._wall() - self._seen)

    def _check_silence(self, silent: float) -> None:
        """Raises UnjudgeableError when frames that came have stopped: the application is not to blame for that."""
        if self._gap is not None and silent > max(SILENCE, GAPS * self._gap):
            raise UnjudgeableError(f"no Frame of the vehicle has come for {silent:.0f} s, and they came before")

    def _request(self, text: str) -> Handler:
        return lambda _message, _sample_time: self.request(text)

    def _take_frame(self, frame: Any, sample_time: int) -> None:
        now = self._wall()
        if self._seen is not None:
            self._gap = max(self._gap or 0.0, now - self._seen)
        self._seen = now
        self.look(vehicle_pose(frame), sample_time)

    def _take_body(self, stamp: int, frame: Any, sample_time: int) -> None:
        self.look_at_body(stamp, vehicle_pose(frame), sample_time)


def _port(text: str, context: Context) -> tuple[str, int | None]:
    """A message and its sender stamp, None for any; raises ValueError for an unknown one."""
    name, _, stamp = text.partition("/")
    context.messages.id(name)
    if stamp and not is_whole(stamp):
        raise ValueError(f"--requests: '{text}' has no whole number as its sender stamp")
    return name, whole(stamp) if stamp else None


def _bodies(flags: Flags) -> Footprints:
    """The bodies that the flags ask for; raises InputError, and ValueError if there are none."""
    if not flags["bodies"]:
        return {}
    found = load_footprints(Path(flags["map-path"]), flags["frame-id"])
    if not found:
        raise ValueError(f"--bodies: {NO_BODIES}")
    return found


build = Collision
