"""Where a vehicle and the bodies of a map are, by their newest frames."""

import math
from collections.abc import Iterable
from functools import partial
from typing import Any

from services.base import Handler
from services.scene.camera import body_pose
from services.scene.outlines import Place


class Places:
    """``known`` has them by sender stamp; ``inputs`` takes the frames of a service."""

    def __init__(self, own: int, moving: Iterable[int]) -> None:
        self.known: dict[int, Place] = {}
        self._own = own
        self.inputs: dict[tuple[str, int | None], Handler] = {
            ("opendlv.sim.Frame", stamp): partial(self._take, stamp) for stamp in (own, *moving)
        }

    @property
    def vehicle(self) -> Place | None:
        """None before its first frame."""
        return self.known.get(self._own)

    def _take(self, stamp: int, frame: Any, _sample_time: int) -> None:
        pose = body_pose(frame)
        x, y, z = pose.position.tolist()
        self.known[stamp] = Place(x, y, z, math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]))
