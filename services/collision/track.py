"""The track by which a vehicle is judged: the obstacles of a map by their purpose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import shapely

from services.collision.gates import Gate
from services.collision.geometry import VehiclePose

Obstacles = Mapping[str, shapely.MultiLineString]


@dataclass(frozen=True)
class Track:
    """Walls must not be touched, and the goal be reached; ``gates`` have to be crossed before, in order.

    Obstacles by name in m, `max_time` in s. The vehicle keeps ``min_margin`` m away from walls; with 0 it only
    must not touch them. ``max_speed`` in m/s, None for no limit.
    """

    walls: Obstacles
    goal: Obstacles
    max_time: float
    gates: tuple[Gate, ...] = ()
    min_margin: float = 0.0
    max_speed: float | None = None


def touched(obstacles: Obstacles, area: shapely.Geometry) -> str | None:
    """The first obstacle that an area touches."""
    return next((name for name, lines in obstacles.items() if shapely.intersects(lines, area)), None)


def nearest(obstacles: Obstacles, area: shapely.Geometry) -> tuple[float, str] | None:
    """The smallest distance of an area to an obstacle (m), and the obstacle's name; None without obstacles."""
    return min(((float(shapely.distance(lines, area)), name) for name, lines in obstacles.items()), default=None)


def length_through(area: shapely.Geometry, lines: Sequence[shapely.Geometry]) -> float:
    """The least way (m) from an area to the first line, from there to the next, and so on, each taken by itself."""
    return sum(float(shapely.distance(start, end)) for start, end in pairwise([area, *lines]))


def fault_of_start(track: Track, area: shapely.Geometry) -> str | None:
    """What is wrong with a test whose vehicle covers this area at first; None if nothing."""
    ends = {} if track.gates else track.goal  # a lap may begin on the line where it ends
    for kind, obstacles in (("wall", track.walls), ("goal", ends)):
        name = touched(obstacles, area)
        if name is not None:
            return f"the vehicle stands on {kind} {name} from the start"
    near = nearest(track.walls, area)
    if near is not None and near[0] < track.min_margin:
        limit = f"expected at least {track.min_margin:g} m"
        return f"the vehicle stands {told(near[0], track.min_margin)} m from wall {near[1]} from the start, {limit}"
    return None


def told(value: float, limit: float) -> str:
    """A value beyond its limit for sentences: with three decimals, or as many as it takes to tell it from the limit."""
    texts = (f"{value:.{decimals}f}" for decimals in range(3, 10))
    return next((text for text in texts if float(text) != limit), str(value))


def place(pose: VehiclePose) -> str:
    """The vehicle's position for sentences."""
    return f"at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"
