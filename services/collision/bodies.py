"""Other bodies that move: their footprints from a map's models, and how close the vehicle comes to each of them.

Metres and rad. A footprint is the convex outline of a model's mesh, as seen from above, in its body's frame: x forward.
Vehicle and body move at the same time, each straight and turning evenly from one of its poses to the next.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import shapely

from dodo_dsl.opendlv.assets.map_file import bodies, read_map
from dodo_dsl.opendlv.assets.track import TURN, VehicleBox, VehiclePose, between, corners
from dodo_dsl.opendlv.envelope import MICROSECONDS

HELD = 2 * MICROSECONDS
"""us without a frame of a body, after which it counts as standing where it was last seen."""
Footprints = Mapping[int, tuple[str, shapely.Geometry]]
"""Name and footprint of each body by the sender stamp of its frames."""


class Approach(NamedTuple):
    """The smallest distance (m) of vehicle and body in a span that ends at a time (us)."""

    time: int
    margin: float


def load_footprints(path: Path, own: int) -> Footprints:
    """The bodies of a map, without the vehicle's ``own`` one; raises InputError."""
    found = bodies(read_map(path).models, own)
    return {
        stamp: (name, shapely.convex_hull(shapely.MultiPoint(model.footprint())))
        for stamp, (name, model) in found.items()
    }


class MovedPath:
    """Where something has been since a time, in us; ``poses`` are newer each than the one before."""

    def __init__(self) -> None:
        self.poses: list[tuple[int, VehiclePose]] = []

    def add(self, time: int, pose: VehiclePose) -> None:
        """A pose that is not newer than the last one is ignored."""
        if not self.poses or time > self.poses[-1][0]:
            self.poses.append((time, pose))

    def at(self, time: int) -> VehiclePose:
        after = next(n for n, (known, _) in enumerate(self.poses) if known >= time)
        later, pose = self.poses[after]
        if later == time:
            return pose
        earlier, start = self.poses[after - 1]
        return between(start, pose, (time - earlier) / (later - earlier))

    def forget(self, time: int) -> None:
        while len(self.poses) > 1 and self.poses[1][0] <= time:
            self.poses.pop(0)


class OtherBody:
    """One body and the vehicle: both are judged up to the time to which their places are known."""

    def __init__(self, name: str, footprint: shapely.Geometry, box: VehicleBox) -> None:
        self.name = name
        self._footprint, self._box = footprint, box
        self._own, self._its = MovedPath(), MovedPath()
        self._until: int | None = None
        self._seen: int | None = None

    @property
    def was_seen(self) -> bool:
        return self._seen is not None

    def first(self) -> float | None:
        """The distance when both are known for the first time, once; None before and after."""
        if self._until is not None or not self._own.poses or not self._its.poses:
            return None
        self._until = max(self._own.poses[0][0], self._its.poses[0][0])
        if min(self._own.poses[-1][0], self._its.poses[-1][0]) < self._until:
            self._until = None
            return None
        own, its = self._own.at(self._until), self._its.at(self._until)
        return least_distance((own, own), (its, its), self._box, self._footprint)

    def take_vehicle(self, time: int, pose: VehiclePose) -> None:
        """A pose of the vehicle; a body that has sent nothing for long stands."""
        self._own.add(time, pose)
        if self._seen is not None and time - self._seen > HELD:
            self.hold()

    def take(self, time: int, pose: VehiclePose) -> None:
        self._seen = max(time, self._seen or time)
        self._its.add(time, pose)

    def hold(self) -> None:
        """The body stands at its newest pose until the vehicle's newest one."""
        if self._its.poses and self._own.poses:
            self._its.add(self._own.poses[-1][0], self._its.poses[-1][1])

    def approaches(self) -> Iterator[Approach]:
        """The spans that were not judged before, each from one pose of either to the next of either."""
        if self._until is None:
            return
        until = min(self._own.poses[-1][0], self._its.poses[-1][0])
        known = {time for path in (self._own, self._its) for time, _ in path.poses if self._until < time < until}
        times = [self._until, *sorted(known), until] if until > self._until else []
        for begin, end in pairwise(times):
            own, its = ((path.at(begin), path.at(end)) for path in (self._own, self._its))
            yield Approach(end, least_distance(own, its, self._box, self._footprint))
        if times:
            self._until = until
            self._own.forget(until)
            self._its.forget(until)


Move = tuple[VehiclePose, VehiclePose]


def least_distance(own: Move, its: Move, box: VehicleBox, footprint: shapely.Geometry) -> float:
    """How close (m) a vehicle comes to a footprint while both move from their first pose to their second at a time.

    Exact if neither turns. A turn is made in parts of five degrees at most, in each of which the vehicle, as seen
    from the body, covers the convex hull of its two rectangles.
    """
    turns = (math.remainder(end.heading - start.heading, math.tau) for start, end in (own, its))
    parts = max(1, math.ceil(max(map(abs, turns)) / TURN))
    shares = [index / parts for index in range(parts + 1)]
    seen = [corners(_seen_from(between(*its, share), between(*own, share)), box) for share in shares]
    hulls = (shapely.convex_hull(shapely.linestrings(a + b)) for a, b in pairwise(seen))
    return min(float(shapely.distance(hull, footprint)) for hull in hulls)


def _seen_from(body: VehiclePose, other: VehiclePose) -> VehiclePose:
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    x, y = other.x - body.x, other.y - body.y
    return VehiclePose(cos * x + sin * y, cos * y - sin * x, other.heading - body.heading)
