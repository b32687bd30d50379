"""Triangles that share a plane and an edge joined to convex polygons: fewer pieces to fill."""

import math

import numpy as np

from services.scene.camera import Array
from services.scene.map.meshes import Indices

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
    """The loop without corners on straight edges; None when it is not convex. In plain numbers, as it has few."""
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


def join(vertices: Array, triangles: Indices) -> tuple[list[Loop], Array]:
    """Convex polygons of at most eight corners, counter-clockwise, and their unit normals (F, 3)."""
    normals = triangle_normals(vertices, triangles)
    loops: dict[int, Loop] = {i: list(map(int, triangle)) for i, triangle in enumerate(triangles)}
    owner = {edge: i for i, loop in loops.items() for edge in _edges(loop)}
    for edge in list(owner):
        one, other = owner.get(edge), owner.get((edge[1], edge[0]))
        if one is None or other is None or one == other or normals[one] @ normals[other] < 1 - _SAME_PLANE:
            continue
        loop = _joined(vertices, loops[one], loops[other], edge, normals[one])
        if loop is None:
            continue
        for old in _edges(loops.pop(one)) + _edges(loops.pop(other)):
            owner.pop(old, None)
        loops[one] = loop
        owner.update(dict.fromkeys(_edges(loop), one))
    kept = sorted(loops)
    return [loops[i] for i in kept], normals[kept]


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
