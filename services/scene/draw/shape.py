"""A model made ready for drawing: convex polygons, their normals, and what culling needs."""

from dataclasses import dataclass

import numpy as np

from services.scene.camera import Array
from services.scene.draw.polygons import MAX_CORNERS, Loop, convex_parts, join
from services.scene.map.meshes import Indices

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
    ``thickness``: faces move inwards by no more.
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


def make_shape(vertices: Array, triangles: Indices) -> Shape:
    """A shape from triangles that face outwards; vertices that no triangle uses are left out."""
    used, corners = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], corners.reshape(-1, 3)
    loops, normals = join(vertices, triangles)
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
    )
