"""The evaluator of an area that has to be passed over, on the bus."""

from pathlib import Path
from typing import Any

import shapely

from dodo_dsl.opendlv.assets import map_file
from services.base import Context, Flags
from services.base.vehicle_pose import vehicle_pose
from services.coverage.model import CoverageEvaluator, CoverageGrid, Footprint, enclosed

_SIDES = ("x-min", "x-max", "y-min", "y-max")


class Coverage(CoverageEvaluator):
    """Takes the vehicle's frames under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        flags = context.flags
        diameter = flags["diameter"]
        footprint = Footprint(diameter, 0.0) if diameter else Footprint(flags["length"], flags["width"])
        grid = CoverageGrid(_area(flags), flags["cell"], footprint)
        super().__init__(flags["area"] or "the rectangle", grid, flags["min-share"], flags["max-time"])
        self.inputs = {("opendlv.sim.Frame", flags["frame-id"]): self._take_frame}

    def _take_frame(self, frame: Any, sample_time: int) -> None:
        self.look(vehicle_pose(frame), sample_time)


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
