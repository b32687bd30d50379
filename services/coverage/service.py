"""The evaluator of an area that has to be passed over, on the bus."""

import math
from pathlib import Path
from typing import Any, Literal

import shapely

from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.track import VehiclePose
from services.base import Check, Context, Evaluator, Flags, JudgedTime, UnjudgeableError, Verdict
from services.base.vehicle_pose import vehicle_pose
from services.coverage.model import CoverageGrid, Footprint, enclosed

_SIDES = ("x-min", "x-max", "y-min", "y-max")


class Coverage(Evaluator):
    """Takes the vehicle's frames under the sender stamp ``frame-id``."""

    period = 10_000

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        self._flags = flags = context.flags
        super().__init__(flags["max-time"])
        diameter = flags["diameter"]
        footprint = Footprint(diameter, 0.0) if diameter else Footprint(flags["length"], flags["width"])
        self._name, self._grid = flags["area"] or "the rectangle", CoverageGrid(_area(flags), flags["cell"], footprint)
        self._last: tuple[int, VehiclePose] | None = None
        self._distance = 0.0
        self._reached: float | None = None
        self.plot = self.judged.series(f"Share of {self._name} passed over", low=flags["min-share"])
        self.inputs = {("opendlv.sim.Frame", flags["frame-id"]): self._take_frame}

    def _take_frame(self, frame: Any, time: int) -> None:
        """Takes a frame, unless it is from before the test or no newer than the last."""
        pose, before = vehicle_pose(frame), self._last
        if self.verdict is not None or (before is not None and time <= before[0]):
            return
        self._last = time, pose
        if self.elapsed(time) < 0:
            return
        if self.is_overdue(time):
            self.time_is_over()
            return
        if before is None or self.elapsed(before[0]) < 0:
            self._grid.cover(pose)
        else:
            self._grid.move(before[1], pose)
            self._distance += math.hypot(pose.x - before[1].x, pose.y - before[1].y)
        self.plot.add(time, self._grid.share, mark=0)
        if self._grid.share >= self._flags["min-share"]:
            self._reached = self.elapsed(time)
            self.verdict = self._verdict("passed", f"passed over {self._said} after {self._reached:.2f} s")

    @property
    def _said(self) -> str:
        return f"{self._grid.share * 100:.4g} % of {self._name}"

    def decide(self, span: JudgedTime) -> Verdict:
        if self._last is None:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {span.within}")
        pose, least = self._last[1], self._flags["min-share"] * 100
        where = f"the vehicle is at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"
        return self._verdict(
            "failed", f"passed over {self._said} {span.within}, expected at least {least:.4g} %; {where}"
        )

    def _verdict(self, outcome: Literal["passed", "failed"], reason: str) -> Verdict:
        time, pose = self._last or (self.zero, VehiclePose(0, 0, 0))
        checks = (
            Check.least("covered", self._grid.share, self._flags["min-share"], parameters=("min-share",)),
            Check.most("time-to-cover", self._reached, self._flags["max-time"], "s", ("max-time",)),
            Check("distance", self._distance, {}, "m"),
        )
        evidence = {"time": self.elapsed(time), "x": pose.x, "y": pose.y}
        return Verdict(outcome, reason, checks, evidence=evidence)


build = Coverage


def _area(flags: Flags) -> shapely.Geometry:
    """The loop of the map, or the rectangle; raises InputError, and ValueError for what is not an area."""
    name, path, sides = flags["area"], flags["map-path"], [flags[side] for side in _SIDES]
    if name is not None and sides != [None] * len(_SIDES):
        raise ValueError("give the area either as a loop of the map, --area, or as a rectangle, --x-min and so on")
    if name is None:
        if missing := [side for side in _SIDES if flags[side] is None]:
            raise ValueError(f"--{missing[0]} of the rectangle is missing")
        for low, high in (_SIDES[:2], _SIDES[2:]):
            if flags[low] >= flags[high]:
                raise ValueError(f"--{low}={flags[low]:g} is not less than --{high}={flags[high]:g}")
        return shapely.box(sides[0], sides[2], sides[1], sides[3])
    if path is None:
        raise ValueError(f"--area={name} needs --map-path, the map that has it")
    obstacles = map_file.read_obstacles(Path(path))
    if name not in obstacles:
        raise ValueError(f"the map {path} has no obstacle '{name}'; it has {', '.join(sorted(obstacles)) or 'none'}")
    found = enclosed(obstacles[name])
    if found is None:
        raise ValueError(
            f"the lines of obstacle '{name}' of the map {path} enclose nothing: they must end where they begin"
        )
    return found
