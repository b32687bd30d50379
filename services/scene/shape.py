"""A model made ready for drawing: convex polygons, their normals, and what culling needs.

Triangles that share a plane and an edge are joined to convex polygons: fewer pieces to fill.
"""

import math
from dataclasses import dataclass

import numpy as np

from services.scene.camera import Array
from services.scene.meshes import Indices

MAX_CORNERS = 8

_SAME_PLANE = 1e-6
_STRAIGHT = 1e-3

Loop = list[int]


def triangle_normals(vertices: Array, triangles: Indices) -> Array:
    """Unit normals (T, 3)."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True), np.float64)


def _convex(vertices: Array, loop: Loop, normal: Array) -> Loop | None:
    """The loop without corners on straight edges; None when it is not convex. In plain numbers, because it has few."""
    points, (nx, ny, nz) = vertices[loop].tolist(), normal.tolist()
    kept = []
    for corner, last, point, following in zip(
        loop, [points[-1], *points], points, [*points[1:], points[0]], strict=False
    ):
        (ax, ay, az), (bx, by, bz) = (
            [q - p for p, q in zip(*ends, strict=True)] for ends in ((last, point), (point, following))
        )
        turn = (ay * bz - az * by) * nx + (az * bx - ax * bz) * ny + (ax * by - ay * bx) * nz
        straight = _STRAIGHT * math.hypot(ax, ay, az) * math.hypot(bx, by, bz)
        if turn < -straight:
            return None
        if turn > straight:
            kept.append(corner)
    return kept


def _turned(loop: Loop, first: int) -> Loop:
    at = loop.index(first)
    return loop[at:] + loop[:at]


def _joined(vertices: Array, one: Loop, other: Loop, edge: tuple[int, int], normal: Array) -> Loop | None:
    """The union across an edge that runs a, b in ``one`` and b, a in ``other``, if it is convex and small."""
    a, b = edge
    loop = _turned(one, b) + _turned(other, a)[1:-1]
    if len(set(loop)) < len(loop):
        return None
    convex = _convex(vertices, loop, normal)
    return convex if convex is not None and 3 <= len(convex) <= MAX_CORNERS else None


def _edges(loop: Loop) -> list[tuple[int, int]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def join(vertices: Array, triangles: Indices, colours: Array | None = None) -> tuple[list[Loop], Array, Indices]:
    """Convex polygons of at most eight corners, counter-clockwise, their unit normals (F, 3), a triangle (F,) of each.

    Those of different ``colours`` (T, 3) are not joined.
    """
    normals = triangle_normals(vertices, triangles)
    loops: dict[int, Loop] = {i: list(map(int, triangle)) for i, triangle in enumerate(triangles)}
    owner = {edge: i for i, loop in loops.items() for edge in _edges(loop)}
    for edge in list(owner):
        one, other = owner.get(edge), owner.get((edge[1], edge[0]))
        if one is None or other is None or one == other or normals[one] @ normals[other] < 1 - _SAME_PLANE:
            continue
        if colours is not None and (colours[one] != colours[other]).any():
            continue
        loop = _joined(vertices, loops[one], loops[other], edge, normals[one])
        if loop is None:
            continue
        for old in _edges(loops.pop(one)) + _edges(loops.pop(other)):
            owner.pop(old, None)
        loops[one] = loop
        owner.update(dict.fromkeys(_edges(loop), one))
    kept = sorted(loops)
    return [loops[i] for i in kept], normals[kept], np.array(kept, np.intp)


def convex_parts(vertices: Array, triangles: Indices) -> list[Indices]:
    """The vertices of each set of triangles that meet at convex edges only, as a cone and its base plate do.

    An edge is convex where the other triangle's far corner does not lie before the plane of the first.
    """
    normals = triangle_normals(vertices, triangles)
    size = float(np.ptp(vertices, axis=0).max())
    part = list(range(len(triangles)))
    owner = {edge: i for i, triangle in enumerate(triangles.tolist()) for edge in _edges(triangle)}
    for (a, b), one in owner.items():
        other = owner.get((b, a))
        if other is not None and other > one:
            far = vertices[triangles[other].sum() - a - b] - vertices[a]
            if normals[one] @ far <= 1e-4 * size:
                part[_root(part, other)] = _root(part, one)
    roots = np.array([_root(part, i) for i in range(len(part))])
    return [np.unique(triangles[roots == root]) for root in np.unique(roots)]


def _root(part: list[int], i: int) -> int:
    while part[i] != i:
        part[i] = part[part[i]]
        i = part[i]
    return i


_MANY_CORNERS = 64
_MANY_PARTS = 6
_DIRECTIONS = 128
_LONGEST_MITRE = 3.0


@dataclass(frozen=True, eq=False)
class Shape:
    """Polygons of a model in its own frame, lengths in m.

    ``vertices`` (V, 3); ``mitres`` (V, 3): how far each vertex moves when all faces move inwards by 1;
    ``faces`` (F, 8) vertex numbers, counter-clockwise from outside, the last one repeated;
    ``normals`` and ``centres`` (F, 3), ``areas`` (F,); ``outlines``: sets of vertices whose
    convex hulls make the silhouette; ``middle`` and ``radius`` of a sphere around all;
    ``thickness``: faces move inwards by no more; ``colours`` (F, 3) of the faces, where these have their own.
    """

    vertices: Array
    mitres: Array
    faces: Indices
    normals: Array
    centres: Array
    areas: Array
    outlines: tuple[Indices, ...]
    middle: Array
    radius: float
    thickness: float
    colours: Array | None = None


def _padded(loops: list[Loop]) -> Indices:
    return np.array([loop + [loop[-1]] * (MAX_CORNERS - len(loop)) for loop in loops], np.intp)


def _mitres(count: int, loops: list[Loop], normals: Array) -> Array:
    """Per vertex the shortest m with n . m = 1 for the normals n around it, in the least squares sense."""
    corners = np.concatenate([np.array(loop) for loop in loops])
    around = np.repeat(normals, [len(loop) for loop in loops], axis=0)
    squares, sums = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(squares, corners, around[:, :, None] * around[:, None, :])
    np.add.at(sums, corners, around)
    mitres = np.einsum("vij,vj->vi", np.linalg.pinv(squares, rcond=1e-3, hermitian=True), sums)
    lengths = np.linalg.norm(mitres, axis=1, keepdims=True)
    return np.asarray(mitres * np.minimum(1.0, _LONGEST_MITRE / np.maximum(lengths, 1e-9)), np.float64)


def _centre_and_area(points: Array) -> tuple[Array, float]:
    fan = np.cross(points[1:-1] - points[0], points[2:] - points[0])
    return points.mean(axis=0), float(np.linalg.norm(fan.sum(axis=0))) / 2


def _sphere_directions(count: int) -> Array:
    """Directions spread evenly over the sphere (a Fibonacci lattice)."""
    step = np.arange(count) + 0.5
    z, turn = 1 - 2 * step / count, step * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - z * z)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def _outermost(vertices: Array, part: Indices) -> Indices:
    """The vertices of a part that are the farthest ones in some direction."""
    if len(part) <= _MANY_CORNERS:
        return part
    farthest = np.argmax(_sphere_directions(_DIRECTIONS) @ vertices[part].T, axis=1)
    return np.asarray(part[np.unique(farthest)], np.intp)


def _outlines(vertices: Array, triangles: Indices) -> tuple[Indices, ...]:
    parts = convex_parts(vertices, triangles)
    if len(parts) > _MANY_PARTS:
        parts = [np.arange(len(vertices))]
    return tuple(_outermost(vertices, part) for part in parts)


def make_shape(vertices: Array, triangles: Indices, colours: Array | None = None) -> Shape:
    """A shape from triangles that face outwards; vertices that no triangle uses are left out.

    ``colours`` (T, 3) are those of the triangles, where they have their own.
    """
    used, corners = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], corners.reshape(-1, 3)
    loops, normals, kept = join(vertices, triangles, colours)
    measured = [_centre_and_area(vertices[loop]) for loop in loops]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2
    return Shape(
        vertices=vertices,
        mitres=_mitres(len(vertices), loops, normals),
        faces=_padded(loops),
        normals=normals,
        centres=np.array([centre for centre, _ in measured]),
        areas=np.array([area for _, area in measured]),
        outlines=_outlines(vertices, triangles),
        middle=middle,
        radius=float(np.linalg.norm(vertices - middle, axis=1).max()),
        thickness=float((high - low).min()) / 4,
        colours=None if colours is None else colours[kept],
    )
