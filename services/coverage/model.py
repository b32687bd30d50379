"""The share of an area that a vehicle has passed over, on a grid of square cells.

A cell counts with its centre. Metres and rad, world frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from dodo_dsl.opendlv.assets.track import VehiclePose, between

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
