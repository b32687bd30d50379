"""The track by which a vehicle is judged: the obstacles of a map by their purpose, gates, and the vehicle's area.

Metres and rad, world frame. Obstacles of an OpenDLV map are lines on the ground that have a name. Gates are lines that
the vehicle's centre has to cross in order. A vehicle is a rectangle on the ground, which covers an area when it moves.
"""

import difflib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import shapely

from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.json_file import MapError

TURN = math.radians(5)  # within a turn of this size a hull is as good as the area driven over


@dataclass(frozen=True)
class VehiclePose:
    """Where the centre of the vehicle is, and its heading counter-clockwise from the x axis."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class VehicleBox:
    """Outline of the vehicle: `length` along its heading, `width` across, both about the centre."""

    length: float
    width: float


def outline(pose: VehiclePose, box: VehicleBox) -> shapely.Polygon:
    """The rectangle that the vehicle covers at a pose."""
    return shapely.Polygon(corners(pose, box))


def corners(pose: VehiclePose, box: VehicleBox) -> list[tuple[float, float]]:
    """The four corners, counter-clockwise from the front left."""
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    along, across = box.length / 2, box.width / 2
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return [
        (pose.x + f * along * cos - s * across * sin, pose.y + f * along * sin + s * across * cos) for f, s in signs
    ]


def swept(start: VehiclePose, end: VehiclePose, box: VehicleBox) -> shapely.Geometry:
    """The area that the vehicle covers from one pose to the next.

    It moves straight and turns evenly the shorter way round, in parts of at most five degrees; each part is
    the convex hull of its two rectangles, which is exact for a vehicle that does not turn.
    """
    change = math.remainder(end.heading - start.heading, math.tau)
    parts = max(1, math.ceil(abs(change) / TURN))
    shares = [index / parts for index in range(parts + 1)]
    rings = [corners(between(start, end, share), box) for share in shares]
    hulls = [shapely.convex_hull(shapely.linestrings(a + b)) for a, b in pairwise(rings)]
    return hulls[0] if parts == 1 else shapely.union_all(hulls)


def between(start: VehiclePose, end: VehiclePose, share: float) -> VehiclePose:
    """The pose after a share of the path from one pose to the next, turned the shorter way round."""
    change = math.remainder(end.heading - start.heading, math.tau)
    x, y = start.x + share * (end.x - start.x), start.y + share * (end.y - start.y)
    return VehiclePose(x, y, start.heading + share * change)


Gate = tuple[str, shapely.MultiLineString]


class Gates:
    """Counts the gates crossed, in either direction and in their order; a gate out of turn does not count.

    A gate may appear more than once, for several laps.
    """

    def __init__(self, gates: Sequence[Gate]) -> None:
        self._gates = gates
        self.crossed = 0

    def __len__(self) -> int:
        return len(self._gates)

    @property
    def next(self) -> Gate | None:
        """The next gate; None when all were crossed."""
        return self._gates[self.crossed] if self.crossed < len(self) else None

    def move(self, start: VehiclePose, end: VehiclePose) -> float | None:
        """The centre moved straight from one pose to the next.

        Returns the share of this path after which all gates were crossed, None while some are left.
        """
        reached = 0.0 if self.next is None else -1.0
        while self.next is not None:
            ahead = [share for share in crossings(self.next[1], start, end) if share > reached]
            if not ahead:
                return None
            reached = min(ahead)
            self.crossed += 1
        return reached


def crossings(lines: shapely.MultiLineString, start: VehiclePose, end: VehiclePose) -> Iterator[float]:
    """The shares of the path from one pose to the next at which it crosses lines.

    Every point is on one side of a line: one that lies on it counts as left of it. So a path of several
    moves crosses a line exactly as often as its ends say, wherever the moves begin and end.
    """
    for (x1, y1), (x2, y2) in (segment for line in lines.geoms for segment in _segments(line)):
        before = (x2 - x1) * (start.y - y1) - (y2 - y1) * (start.x - x1)
        after = (x2 - x1) * (end.y - y1) - (y2 - y1) * (end.x - x1)
        if (before >= 0) != (after >= 0) and _is_left(start, end, x1, y1) != _is_left(start, end, x2, y2):
            yield before / (before - after)


def _segments(line: shapely.LineString) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    return zip(line.coords[:-1], line.coords[1:], strict=True)


def _is_left(start: VehiclePose, end: VehiclePose, x: float, y: float) -> bool:
    return (end.x - start.x) * (y - start.y) - (end.y - start.y) * (x - start.x) >= 0


Obstacles = Mapping[str, shapely.Geometry]
"""Lines, or the ground that blocks stand on, by name."""


@dataclass(frozen=True)
class Track:
    """Walls must not be touched, and the goal be reached; ``gates`` have to be crossed before, in order.

    Obstacles by name in m, `max_time` in s. The vehicle keeps ``min_margin`` m away from walls; with 0 it only
    must not touch them. ``min_body_margin`` is the same of other bodies. ``max_speed`` in m/s, None for no limit.
    """

    walls: Obstacles
    goal: Obstacles
    max_time: float
    gates: tuple[Gate, ...] = ()
    min_margin: float = 0.0
    max_speed: float | None = None
    min_body_margin: float = 0.0


def touched(obstacles: Obstacles, area: shapely.Geometry) -> str | None:
    """The first obstacle that an area touches."""
    return next((name for name, lines in obstacles.items() if shapely.intersects(lines, area)), None)


def nearest(obstacles: Obstacles, area: shapely.Geometry) -> tuple[float, str] | None:
    """The smallest distance of an area to an obstacle (m), and the obstacle's name; None without obstacles."""
    return min(((float(shapely.distance(lines, area)), name) for name, lines in obstacles.items()), default=None)


def length_through(area: shapely.Geometry, lines: Sequence[shapely.Geometry]) -> float:
    """The shortest distance (m) from an area to the first line, from there to the next, and so on, each by itself."""
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
    """A value beyond its limit for sentences: with three decimals, or as many as distinguish it from the limit."""
    texts = (f"{value:.{decimals}f}" for decimals in range(3, 10))
    return next((text for text in texts if float(text) != limit), str(value))


def place(pose: VehiclePose) -> str:
    """The vehicle's position for sentences."""
    return f"at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"


class ObstaclesError(ValueError):
    """A map that cannot be read, or that lacks an obstacle; the message names file and place."""


def load_obstacles(path: Path) -> dict[str, shapely.MultiLineString]:
    """The obstacles of the map in a folder (its `map.json`) or of the map file itself, by name, in metres.

    Obstacles of one name are one. Raises ObstaclesError.
    """
    try:
        found = map_file.read_obstacles(path)
    except MapError as error:
        raise ObstaclesError(str(error)) from None
    return {name: shapely.MultiLineString(lines) for name, lines in found.items()}


def load_blocks(path: Path, height: float) -> dict[str, shapely.Geometry]:
    """The ground that the blocks of each name stand on, as far as a vehicle of ``height`` m may touch them.

    Raises ObstaclesError.
    """
    try:
        found = map_file.read_footprints(path, height)
    except MapError as error:
        raise ObstaclesError(str(error)) from None
    return {name: shapely.union_all([shapely.Polygon(each) for each in outlines]) for name, outlines in found.items()}


Shape = TypeVar("Shape", bound=shapely.Geometry)


def pick(known: Mapping[str, Shape], names: Sequence[str], parameter: str, path: Path) -> dict[str, Shape]:
    """Those obstacles that a parameter names, prepared for many queries; MapError for an unknown name."""
    chosen = {}
    for name in names:
        if name not in known:
            raise ObstaclesError(f"--{parameter}: {_unknown(name, list(known), path)}")
        shapely.prepare(known[name])
        chosen[name] = known[name]
    return chosen


EVERY, BLOCKS = "*", "blocks"
"""As a wall: all obstacles that are neither goal nor gate, and all blocks in the vehicle's path."""


def pick_walls(
    known: Obstacles, names: Sequence[str], others: Collection[str], path: Path, height: float
) -> dict[str, shapely.Geometry]:
    """Obstacles, and blocks by their names, that a vehicle of ``height`` m must not touch; ``others`` are not walls.

    Raises ObstaclesError for a name that is neither, and if nothing stands in the vehicle's path.
    """
    blocks = {} if all(name in known or name == EVERY for name in names) else load_blocks(path, height)
    standing = {name: area for name, area in blocks.items() if not area.is_empty}
    groups = {EVERY: [name for name in known if name not in others], BLOCKS: list(standing)}
    shapes = {**standing, **known}
    for name in names:
        if name not in shapes and (name in blocks or groups.get(name) == []):
            what = (
                "obstacle" if name == EVERY else f"block between {map_file.LOWEST:g} and {height:g} m above the ground"
            )
            raise ObstaclesError(f"--walls: {name!r} names no {what} in the map {path}")
    found = [each for name in names for each in ([name] if name in shapes else groups.get(name, [name]))]
    return pick(shapes, found, "walls", path)


def _unknown(name: str, known: list[str], path: Path) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"it has {', '.join(sorted(known)) or 'none'}"
    return f"the map {path} has no obstacle {name!r}; {hint}"
