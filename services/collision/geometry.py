"""A vehicle as a rectangle on the ground, and the area it covers when it moves. Metres and rad, world frame."""

import math
from dataclasses import dataclass
from itertools import pairwise

import shapely

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
