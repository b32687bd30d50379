"""The track by which a vehicle is judged: the obstacles of a map by their purpose, gates, and the vehicle's area.

Metres and rad, world frame. Obstacles of an OpenDLV map are lines on the ground that have a name. Gates are lines that
the vehicle's centre has to cross in order. A vehicle is a rectangle on the ground, which covers an area when it moves.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import shapely

from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.json_file import near

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
    return shapely.Polygon(corners(pose, box))


def corners(pose: VehiclePose, box: VehicleBox) -> list[tuple[float, float]]:
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
    rings = [corners(between(start, end, index / parts), box) for index in range(parts + 1)]
    hulls = [shapely.convex_hull(shapely.linestrings(a + b)) for a, b in pairwise(rings)]
    return hulls[0] if parts == 1 else shapely.union_all(hulls)


def between(start: VehiclePose, end: VehiclePose, share: float) -> VehiclePose:
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
    ``min_distance`` m have to be driven.
    """

    walls: Obstacles
    goal: Obstacles
    max_time: float
    gates: tuple[Gate, ...] = ()
    min_margin: float = 0.0
    max_speed: float | None = None
    min_body_margin: float = 0.0
    min_distance: float = 0.0
    reaches: dict[float, shapely.Geometry] = field(default_factory=dict, init=False, compare=False)
    """The ground within a distance (m) of walls, as far as it is known."""


THIN = 1e-6
"""m: how wide a line is that divides the ground."""


def _free_ground(track: Track, pose: VehiclePose, box: VehicleBox) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Where the centre may be, half the vehicle's width from walls: with a way around all of the map, and without."""
    known = [outline(pose, box), *track.walls.values(), *track.goal.values(), *(lines for _, lines in track.gates)]
    hull = shapely.convex_hull(shapely.geometrycollections(known))
    reach = min(box.length, box.width) / 2
    if reach not in track.reaches:
        parts = shapely.get_parts([*track.walls.values()])
        track.reaches[reach] = shapely.union_all(shapely.buffer(parts, reach, quad_segs=2))  # at once is slow
    walls = track.reaches[reach]
    around = shapely.box(*hull.bounds).buffer(box.length + box.width, quad_segs=1)
    return shapely.difference(around, walls), shapely.difference(hull, walls)


def _part_at(ground: shapely.Geometry, place: shapely.Point) -> shapely.Geometry:
    return min(shapely.get_parts(ground), key=place.distance, default=ground)


class Goal:
    """The lines to be reached, each from the sides to which the vehicle can come without crossing any of them.

    If a way around the track leads to both sides of a line, the course's is that between the walls, forwards from where
    the vehicle starts: across the lane, a line through its centre is closed, as a lap begins past its finish. If the
    goal is not found so, or comes after gates, both sides count.
    """

    def __init__(self, track: Track, start: VehiclePose, box: VehicleBox) -> None:
        self.came_from_behind = False
        self._past = 0
        self._lines = [each for lines in track.goal.values() for line in lines.geoms for each in _segments(line)]
        ground, between_walls = _free_ground(track, start, box)
        here = shapely.Point(start.x, start.y)
        self._sides = self._reached(ground, here)
        if not any(map(any, self._sides)):
            self._sides = [(True, True) for _ in self._lines]
        elif any(map(all, self._sides)) and not track.gates:
            cos, sin = math.cos(start.heading), math.sin(start.heading)
            far = between_walls.length
            across = shapely.LineString((start.x - f * sin, start.y + f * cos) for f in (-far, far))
            across = _part_at(shapely.intersection(between_walls, across), here).buffer(THIN)
            ahead = shapely.Point(start.x + 3 * THIN * cos, start.y + 3 * THIN * sin)
            course = self._reached(shapely.difference(between_walls, across), ahead)
            self._sides = course if any(map(any, course)) else self._sides

    def _reached(self, ground: shapely.Geometry, place: shapely.Point) -> list[tuple[bool, bool]]:
        lines = [shapely.LineString(line) for line in self._lines]
        part = _part_at(shapely.difference(ground, shapely.union_all(lines).buffer(THIN)), place)
        left, right = (shapely.intersects(part, shapely.offset_curve(lines, 3 * f * THIN)).tolist() for f in (1, -1))
        return list(zip(left, right, strict=True))

    def move(self, start: VehiclePose, end: VehiclePose, area: shapely.Geometry) -> bool:
        """Whether the vehicle, which covers this area, comes to a line from a side that counts.

        What crossed it the other way has to go back first.
        """
        found, past = False, self._past
        for ((x1, y1), (x2, y2)), sides in zip(self._lines, self._sides, strict=True):
            line = shapely.MultiLineString([[(x1, y1), (x2, y2)]])
            if area.intersects(line):
                counts = sides[0 if (x2 - x1) * (start.y - y1) - (y2 - y1) * (start.x - x1) >= 0 else 1]
                found, self.came_from_behind = found or (counts and not past), self.came_from_behind or not counts
                if not all(sides) and any(crossings(line, start, end)):
                    self._past = max(0, self._past - 1) if counts else self._past + 1
        return found


def touched(obstacles: Obstacles, area: shapely.Geometry) -> str | None:
    return next((name for name, lines in obstacles.items() if shapely.intersects(lines, area)), None)


def nearest(obstacles: Obstacles, area: shapely.Geometry) -> tuple[float, str] | None:
    """The smallest distance of an area to an obstacle (m), and the obstacle's name; None without obstacles."""
    return min(((float(shapely.distance(lines, area)), name) for name, lines in obstacles.items()), default=None)


def length_through(area: shapely.Geometry, lines: Sequence[shapely.Geometry]) -> float:
    """The shortest distance (m) from an area to the first line, from there to the next, and so on, each by itself."""
    return sum(float(shapely.distance(start, end)) for start, end in pairwise([area, *lines]))


def fault_of_start(track: Track, pose: VehiclePose, box: VehicleBox) -> str | None:
    ends, area, least = {} if track.gates else track.goal, outline(pose, box), track.min_margin  # laps may end there
    for kind, obstacles in (("wall", track.walls), ("goal", ends)):
        if name := touched(obstacles, area):
            return f"the vehicle stands on {kind} {name} from the start, {place(pose)}"
    if (near := nearest(track.walls, area)) and near[0] < least:
        far = f"{told(near[0], least)} m from wall {near[1]} from the start, expected at least {least:g} m"
        return f"the vehicle stands {far}, {place(pose)}"
    ground, _ = _free_ground(track, pose, box)
    here = _part_at(ground, shapely.Point(pose.x, pose.y)).buffer(THIN)
    for name, lines in [*track.gates, *track.goal.items()]:
        if lines.intersects(ground) and not lines.intersects(here):
            return f"walls are between the vehicle and {name} from the start, {place(pose)}"
    return None


def told(value: float, limit: float) -> str:
    """A value beyond its limit for sentences: with three decimals, or as many as distinguish it from the limit."""
    texts = (f"{value:.{decimals}f}" for decimals in range(3, 10))
    return next((text for text in texts if float(text) != limit), str(value))


def place(pose: VehiclePose) -> str:
    return f"at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"


def load_obstacles(path: Path) -> dict[str, shapely.MultiLineString]:
    """The obstacles of a map by name, as ``map_file.read_obstacles`` has them; raises InputError."""
    return {name: shapely.MultiLineString(lines) for name, lines in map_file.read_obstacles(path).items()}


Shape = TypeVar("Shape", bound=shapely.Geometry)


def pick(known: Mapping[str, Shape], names: Sequence[str], parameter: str, path: Path) -> dict[str, Shape]:
    """Those obstacles that a parameter names, prepared for many queries; ValueError for an unknown name."""
    for name in names:
        if name not in known:
            hint = near(name, known) or f"it has {', '.join(sorted(known)) or 'none'}"
            raise ValueError(f"--{parameter}: the map {path} has no obstacle {name!r}; {hint}")
        shapely.prepare(known[name])
    return {name: known[name] for name in names}


EVERY, BLOCKS = "*", "blocks"
"""As a wall: all obstacles that are neither goal nor gate, and all blocks in the vehicle's path."""


def pick_walls(
    known: Obstacles, names: Sequence[str], others: Collection[str], path: Path, height: float
) -> dict[str, shapely.Geometry]:
    """Obstacles, and blocks by their names, that a vehicle of ``height`` m must not touch; ``others`` are not walls.

    Raises ValueError for a name that is neither, and if nothing stands in the vehicle's path.
    """
    outlines = {} if all(name in known or name == EVERY for name in names) else map_file.read_footprints(path, height)
    areas = {name: [shapely.Polygon(each) for each in found] for name, found in outlines.items() if found}
    standing = {name: shapely.union_all(each) for name, each in areas.items()}
    groups = {EVERY: [name for name in known if name not in others], BLOCKS: list(standing)}
    shapes = {**standing, **known}
    for name in names:
        if name not in shapes and (name in outlines or groups.get(name) == []):
            blocks = f"block between {map_file.LOWEST:g} and {height:g} m above the ground"
            raise ValueError(f"--walls: {name!r} names no {'obstacle' if name == EVERY else blocks} in the map {path}")
    found = [each for name in names for each in ([name] if name in shapes else groups.get(name, [name]))]
    return pick(shapes, found, "walls", path)


def track(flags: Mapping[str, Any]) -> Track:
    """The obstacles that the flags name, of the map; raises InputError, and ValueError if they make no track."""
    path, goal, walls, gates = Path(flags["map-path"]), flags["goal"], flags["walls"], flags["gates"]
    least = flags["min-distance"]
    if least is None:
        least = 0.0 if goal or gates else flags["length"]
    for parameter, name in (("goal", goal), *(("gates", gate) for gate in gates)):
        if name in walls:
            raise ValueError(f"--{parameter}: {name} is one of the --walls too")
    if flags["min-margin"] and not walls:
        raise ValueError("--min-margin needs --walls")
    if not flags["requests"]:
        raise ValueError("--requests is empty: a drive is the application's only if it sends something")
    obstacles = load_obstacles(path)
    picked = pick(obstacles, gates, "gates", path)
    return Track(
        walls=pick_walls(obstacles, walls, {goal, *gates}, path, flags["height"] or map_file.HIGHEST),
        goal=pick(obstacles, [goal] if goal else [], "goal", path),
        max_time=flags["max-time"],
        gates=tuple((name, picked[name]) for name in gates),
        min_margin=flags["min-margin"],
        max_speed=flags["max-speed"],
        min_body_margin=flags["min-body-margin"] or 0.0,
        min_distance=least,
    )
