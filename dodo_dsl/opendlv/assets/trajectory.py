"""A trajectory through way points of a table or a list: where a vehicle is at a time, its heading and its velocity.

World: metres, z up, heading counter-clockwise from the x axis. Between two way points position and heading change
evenly, the heading by the shorter way round (at exactly half a turn: to the left).
"""

import bisect
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from dodo_dsl.opendlv.assets.table import Table
from dodo_dsl.opendlv.numbers import number


class TrajectoryError(ValueError):
    """Way points that make no trajectory; one sentence, and the ``point`` where it is one's fault."""

    def __init__(self, what: str, point: "PathPoint | None" = None) -> None:
        super().__init__(f"{point.place}: {what}" if point else what)
        self.what, self.line = what, point.line if point else 0


@dataclass(frozen=True)
class PathPoint:
    """A way point as written: ``place`` is where, x, y, z in m, ``yaw`` in rad and ``time`` in s where known.

    ``line`` is that of a table, from 1.
    """

    place: str
    x: float
    y: float
    z: float = 0.0
    yaw: float | None = None
    time: float | None = None
    line: int = 0


@dataclass(frozen=True)
class TrajectoryPose:
    """Where the vehicle is: m and rad in the world, and its velocity there in m/s and rad/s."""

    x: float
    y: float
    z: float
    yaw: float
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rate: float = 0.0

    @property
    def body_velocity(self) -> tuple[float, float, float]:
        """The velocity along the vehicle's own axes, forward, left and up (m/s)."""
        (vx, vy, vz), c, s = self.velocity, math.cos(self.yaw), math.sin(self.yaw)
        return c * vx + s * vy, c * vy - s * vx, vz


class Trajectory:
    """Poses over time, from two way points or more.

    Before the first point's time the vehicle stands there. After the last point's it stands there, or drives on as
    between the last two where the trajectory is ``endless``.
    """

    def __init__(self, points: Sequence[PathPoint], speed: float, endless: bool = False) -> None:
        """``speed`` (m/s) makes the times where the points have none; raises TrajectoryError."""
        if len(points) < 2:
            raise TrajectoryError("expected two way points or more", points[0] if points else None)
        yaws = [p.yaw for p in points if p.yaw is not None]
        turned = yaws if len(yaws) == len(points) else headings(points)
        self._times = _timed(points) if points[0].time is not None else _at_speed(points, speed)
        self._points = [(p.x, p.y, p.z, yaw) for p, yaw in zip(points, turned, strict=True)]
        self.duration = math.inf if endless else self._times[-1]

    def at(self, time: float) -> TrajectoryPose:
        """The pose ``time`` seconds after the start; the velocity at a way point is the one from there on."""
        index = max(min(bisect.bisect_right(self._times, time), len(self._times) - 1), 1)
        (begin, end), (a, b) = self._times[index - 1 : index + 1], self._points[index - 1 : index + 1]
        if time < begin or (time >= end and time >= self.duration):
            x, y, z, yaw = a if time < begin else b
            return TrajectoryPose(x, y, z, wrapped(yaw))
        took, turn, share = end - begin, wrapped(b[3] - a[3]), (time - begin) / (end - begin)
        x, y, z = (p + share * (q - p) for p, q in zip(a[:3], b[:3], strict=True))
        velocity = ((b[0] - a[0]) / took, (b[1] - a[1]) / took, (b[2] - a[2]) / took)
        return TrajectoryPose(x, y, z, wrapped(a[3] + share * turn), velocity, turn / took)


def wrapped(angle: float) -> float:
    """The same angle above -pi and up to pi."""
    turned = math.remainder(angle, math.tau)
    return math.pi if turned == -math.pi else turned


def headings(points: Sequence[PathPoint]) -> list[float]:
    """The heading (rad) at each point of a vehicle that looks where it goes.

    It is half-way between the directions of the parts before and after the point. Raises TrajectoryError when all
    points are at one position.
    """
    parts = [math.atan2(b.y - a.y, b.x - a.x) if (a.x, a.y) != (b.x, b.y) else None for a, b in pairwise(points)]
    known = next((part for part in parts if part is not None), None)
    if known is None:
        raise TrajectoryError("all way points are at one position: give a yaw", points[-1])
    directions = []
    for part in parts:  # standing still it looks as before
        known = known if part is None else part
        directions.append(known)
    inner = [a + wrapped(b - a) / 2 for a, b in pairwise(directions)]
    return [directions[0], *inner, directions[-1]]


def _timed(points: Sequence[PathPoint]) -> list[float]:
    times = [p.time for p in points if p.time is not None]
    if times[0] < 0:
        raise TrajectoryError(f"time: {times[0]:g} is before the start", points[0])
    return times


def _at_speed(points: Sequence[PathPoint], speed: float) -> list[float]:
    times = [0.0]
    for a, b in pairwise(points):
        length = math.dist((a.x, a.y, a.z), (b.x, b.y, b.z))
        if length == 0:
            raise TrajectoryError("the same position as the point before: give times instead of a speed", b)
        times.append(times[-1] + length / speed)
    return times


def straight(x: float, y: float, z: float, yaw: float, length: float | None, speed: float) -> Trajectory:
    """A straight trajectory from a position along ``yaw`` (rad), without end if it has no ``length`` (m)."""
    begin = PathPoint("the start", x, y, z, yaw)
    reach = length or 1.0
    end = replace(begin, x=x + reach * math.cos(yaw), y=y + reach * math.sin(yaw))
    return Trajectory([begin, end], speed, endless=length is None)


NEEDED, POSSIBLE = ("x", "y"), ("x", "y", "z", "yaw", "time")


def read_table(path: Path, height: float) -> list[PathPoint]:
    """The way points of a CSV file with a header; ``height`` (m) counts if there is no column z.

    Columns x, y and z in m, yaw in rad, time in s; other columns are ignored. Raises InputError.
    """
    table = Table(path)
    if any(name not in table.names for name in NEEDED):
        table.lacks("the columns x and y")
    columns = {name: table.numbers(name) for name in POSSIBLE if name in table.names}
    values = [dict(zip(columns, each, strict=True)) for each in zip(*columns.values(), strict=True)]
    return [
        PathPoint(f"{path}:{row.line}", **{"z": height, **each}, line=row.line)
        for row, each in zip(table.rows, values, strict=True)
    ]


def read_points(texts: Iterable[str], height: float) -> list[PathPoint]:
    found: list[PathPoint] = []
    for text in texts:
        try:
            x, y = map(number, text.split())
        except ValueError:
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise TrajectoryError(f"the point '{text}': expected two finite numbers x and y in m, such as '2 0.5'")
        found.append(PathPoint(f"the point '{text}'", x, y, height))
    return found
