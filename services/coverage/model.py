"""The share of an area that a vehicle has passed over, on a grid of square cells, and the verdict on it.

A cell counts with its centre. Metres and rad, world frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from dodo_dsl.opendlv.assets.track import VehiclePose, between
from services.base import Check, Evaluator, JudgedTime, UnjudgeableError, Verdict

MOST_CELLS = 4_000_000
_STEPS = 100_000
"""Of a path between two frames, at most: a vehicle that jumps farther covers less of it."""


@dataclass(frozen=True)
class Footprint:
    """What passes over: a rectangle of ``length`` along the heading and ``width`` across, or if that is 0 a disc."""

    length: float
    width: float

    @property
    def reach(self) -> float:
        return math.hypot(self.length, self.width) / 2

    @property
    def thickness(self) -> float:
        return min(self.length, self.width) or self.length

    def holds(self, along: NDArray[np.float64], across: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of these points are below it, from its centre."""
        if not self.width:
            return np.hypot(along, across) <= self.length / 2
        inside: NDArray[np.bool_] = (np.abs(along) <= self.length / 2) & (np.abs(across) <= self.width / 2)
        return inside


def enclosed(lines: Sequence[Sequence[Sequence[float]]]) -> shapely.Geometry | None:
    """What lines of two points or more enclose, in any order, with what lies in loops within; None for nothing."""
    found = shapely.polygonize([shapely.unary_union(shapely.multilinestrings([list(line) for line in lines]))])
    rings = [shapely.Polygon(part.exterior) for part in found.geoms]
    return shapely.union_all(rings) if rings else None


class CoverageGrid:
    """The cells of ``area`` by rows of y, of ``cell`` m; raises ValueError for too many, and for none."""

    def __init__(self, area: shapely.Geometry, cell: float, footprint: Footprint) -> None:
        left, low, right, high = shapely.bounds(area).tolist()
        columns, rows = (max(1, math.ceil(size / cell - 1e-9)) for size in (right - left, high - low))
        if columns * rows > MOST_CELLS:
            least = math.sqrt((right - left) * (high - low) / MOST_CELLS)
            raise ValueError(f"--cell={cell:g} makes {columns * rows:,} cells, expected {least:.2g} m or more")
        self._x, self._y = left + (np.arange(columns) + 0.5) * cell, low + (np.arange(rows) + 0.5) * cell
        shapely.prepare(area)
        self._left = shapely.contains_xy(area, *np.meshgrid(self._x, self._y))
        """The cells that are left to cover."""
        self.cells = self.left = int(self._left.sum())
        if not self.cells:
            raise ValueError(f"no cell of {cell:g} m has its centre in the area: give a smaller --cell")
        self._cell, self._footprint = cell, footprint

    @property
    def share(self) -> float:
        return (self.cells - self.left) / self.cells

    def cover(self, pose: VehiclePose) -> None:
        reach = self._footprint.reach
        columns, rows = (
            slice(*np.searchsorted(places, [centre - reach, centre + reach]))
            for places, centre in ((self._x, pose.x), (self._y, pose.y))
        )
        part = self._left[rows, columns]
        if not part.any():
            return
        x, y = self._x[columns] - pose.x, self._y[rows, np.newaxis] - pose.y
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        covered = part & self._footprint.holds(x * cos + y * sin, y * cos - x * sin)
        part &= ~covered
        self.left -= int(covered.sum())

    def move(self, start: VehiclePose, end: VehiclePose) -> None:
        """The vehicle went straight from one pose to the next, and turned evenly the shorter way round.

        It is looked at where no point of it has moved by more than half a cell, or half of what is thinner than that.
        """
        turn = math.remainder(end.heading - start.heading, math.tau)
        way = math.hypot(end.x - start.x, end.y - start.y) + abs(turn) * self._footprint.reach
        steps = min(_STEPS, max(1, math.ceil(2 * way / min(self._cell, self._footprint.thickness))))
        for step in range(1, steps + 1):
            self.cover(between(start, end, step / steps))


class CoverageEvaluator(Evaluator):
    """Judges the vehicle's poses in test time; ``name`` is the area's, ``least`` the share of it to cover."""

    period = 10_000

    def __init__(self, name: str, grid: CoverageGrid, least: float, max_time: float) -> None:
        super().__init__(max_time)
        self._name, self._grid, self._least, self._limit = name, grid, least, max_time
        self._last: tuple[int, VehiclePose] | None = None
        self._distance, self._reached = 0.0, None
        self.plot = self.judged.series(f"Share of {name} passed over", low=least)

    _reached: float | None

    def look(self, pose: VehiclePose, time: int) -> None:
        """The vehicle is at a pose; one that is not newer than the last, or of before the test, is ignored."""
        before = self._last
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
        if self._grid.share >= self._least:
            self._reached = self.elapsed(time)
            self.verdict = self._verdict("passed", f"passed over {self._said} after {self._reached:.2f} s")

    @property
    def _said(self) -> str:
        return f"{self._grid.share * 100:.4g} % of {self._name}"

    def decide(self, span: JudgedTime) -> Verdict:
        if self._last is None:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {span.within}")
        pose = self._last[1]
        where = f"the vehicle is at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"
        reason = f"passed over {self._said} {span.within}, expected at least {self._least * 100:.4g} %; {where}"
        return self._verdict("failed", reason)

    def checks(self) -> tuple[Check, ...]:
        covered, reached = self._grid.share, self._reached
        return (
            Check.least("covered", covered, self._least, parameters=("min-share",)),
            Check.most("time-to-cover", reached, self._limit, "s", ("max-time",)),
            Check("distance", self._distance, {}, "m"),
        )

    def _verdict(self, outcome: Literal["passed", "failed"], reason: str) -> Verdict:
        time, pose = self._last or (self.zero, VehiclePose(0, 0, 0))
        evidence = {"time": self.elapsed(time), "x": pose.x, "y": pose.y}
        return Verdict(outcome, reason, self.checks(), evidence=evidence)
