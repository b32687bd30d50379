"""OBJ files as triangles: loaded by trimesh, welded, and solids of revolution with fewer sides."""

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets import mesh_text
from dodo_dsl.opendlv.assets.json_file import MapError, read_bytes
from services.scene.camera import Array

Indices = npt.NDArray[np.intp]

ROUND_SIDES = 16


def weld(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Corners closer than a millionth of the mesh's size made one; triangles that lose a corner go."""
    size = float(np.ptp(vertices, axis=0).max())
    grid = np.rint(vertices / max(size * 1e-6, 1e-12))
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    corners = inverse.reshape(-1)[triangles]
    return vertices[first], corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]


def with_area(vertices: Array, triangles: Indices) -> Indices:
    """The triangles that are more than a line."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.asarray(triangles[doubled > 1e-6 * longest], np.intp)


def _is_ring(angles: Array) -> bool:
    turned = np.sort(angles)
    gaps = np.diff(turned, append=turned[0] + 2 * np.pi)
    return len(turned) > ROUND_SIDES and float(gaps.max()) < 2 * np.pi / ROUND_SIDES


def with_fewer_sides(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """A solid of revolution about a vertical axis with 16 sides; every other mesh unchanged.

    The corners must form rings of one height and radius, each all around the axis; on such a surface
    a corner may move along its ring.
    """
    middle = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    offset = vertices[:, :2] - middle[:2]
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    profile = np.column_stack([np.hypot(offset[:, 0], offset[:, 1]), vertices[:, 2]])
    size = float(np.ptp(vertices, axis=0).max())
    rings, ring = np.unique(np.rint(profile / (size * 1e-3)), axis=0, return_inverse=True)
    for index, (steps, _) in enumerate(rings):
        members = ring.reshape(-1) == index
        if steps > 0 and not _is_ring(angle[members]):
            return vertices, triangles
        profile[members] = profile[members].mean(axis=0) if steps > 0 else (0.0, profile[members, 1].mean())
    step = 2 * np.pi / ROUND_SIDES
    angle = np.rint(angle / step) % ROUND_SIDES * step
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    return weld(np.column_stack([directions * profile[:, :1] + middle[:2], profile[:, 1]]), triangles)


def is_closed(triangles: Indices) -> bool:
    """Whether each edge is used once in each direction: the outside of such a mesh is known."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = int(triangles.max()) + 1
    forth, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    return len(np.unique(forth)) == len(forth) and bool(np.array_equal(np.sort(forth), np.sort(back)))


def volume(vertices: Array, triangles: Indices) -> float:
    """What a closed mesh encloses, in cubic units; negative when its triangles face inwards."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def oriented(vertices: Array, triangles: Indices) -> Indices:
    """Triangles that all face outwards (counter-clockwise); those of an open mesh face both ways."""
    if not is_closed(triangles):
        return np.concatenate([triangles, triangles[:, ::-1]])
    return triangles if volume(vertices, triangles) > 0 else triangles[:, ::-1]


def _parse(path: Path, data: bytes) -> tuple[Array, Indices]:
    mesh_text.check(path, data)
    from services.scene.mesh_library import trimesh

    try:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type="obj", process=False, skip_materials=True)
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.intp)
    except (ValueError, IndexError, KeyError, TypeError, AttributeError) as error:
        raise MapError(path, f"not a readable OBJ file: {error}") from error
    return vertices, faces


def load_obj(path: Path) -> tuple[Array, Indices]:
    """Vertices (V, 3) in m and triangles (T, 3) of an OBJ file; MapError when there is nothing to draw."""
    vertices, triangles = _parse(path, read_bytes(path))
    if len(triangles) == 0:
        raise MapError(path, "the OBJ file has no faces")
    if len(triangles) > mesh_text.MAX_TRIANGLES:
        raise MapError(path, f"{len(triangles)} triangles, expected at most {mesh_text.MAX_TRIANGLES}")
    if not np.isfinite(vertices).all() or np.abs(vertices).max() > 1e5:
        raise MapError(path, "the OBJ file has vertices that are not finite numbers below 100 km")
    vertices, triangles = with_fewer_sides(*weld(vertices, triangles))
    if len(with_area(vertices, triangles)) == 0:
        raise MapError(path, "no face of the OBJ file has an area")
    return vertices, with_area(vertices, oriented(vertices, triangles))
