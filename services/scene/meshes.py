"""OBJ files as triangles: welded, solids of revolution with fewer sides, and in the colours of their materials."""

import importlib
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets import mesh_text
from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.camera import Array
from services.scene.raster import Image
from services.scene.textures import Texture, load_picture

Indices = npt.NDArray[np.intp]

ROUND_SIDES = 16
_PIXELS = 256
"""So wide and high textures are at most that give faces their colours."""


def weld(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Corners closer than a millionth of the mesh's size made one; triangles may lose corners."""
    size = float(np.ptp(vertices, axis=0).max())
    grid = np.rint(vertices / max(size * 1e-6, 1e-12))
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return vertices[first], inverse.reshape(-1)[triangles]


def have_area(vertices: Array, triangles: Indices) -> npt.NDArray[np.bool_]:
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.asarray(doubled > 1e-6 * longest, np.bool_)


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


@cache
def _trimesh() -> Any:
    """Loaded without scipy, which OBJ files do not need and which takes longer to load than all else together."""
    without = {"scipy"} - {*sys.modules}
    sys.modules.update(dict.fromkeys(without, cast(ModuleType, None)))  # it does without what cannot be imported
    try:
        return importlib.import_module("trimesh")
    finally:
        for name in without:
            del sys.modules[name]


def _mesh(vertices: Array, triangles: Indices) -> Any:
    return _trimesh().Trimesh(vertices, triangles, process=False)


def is_closed(vertices: Array, triangles: Indices) -> bool:
    """Whether each edge is used once in each direction: the outside of such a mesh is known."""
    mesh = _mesh(vertices, triangles)
    return bool(mesh.is_watertight and mesh.is_winding_consistent)


def oriented(vertices: Array, triangles: Indices) -> Indices:
    """Triangles that all face outwards (counter-clockwise); those of an open mesh face both ways."""
    if not is_closed(vertices, triangles):
        return np.concatenate([triangles, triangles[:, ::-1]])
    return triangles if _mesh(vertices, triangles).volume > 0 else triangles[:, ::-1]


def _loaded(path: Path, mesh: mesh_text.Mesh) -> tuple[Array, Indices, Indices]:
    """Vertices, triangles and the number of each one's face; InputError when there is nothing to draw."""
    triangles, faces = (np.array(each, np.intp) for each in mesh.triangles())
    vertices, triangles = with_fewer_sides(*weld(np.array(mesh.vertices), triangles))
    has_corners = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles, faces = oriented(vertices, triangles[has_corners]), faces[has_corners]
    has_area = have_area(vertices, triangles)
    if not has_area.any():
        raise InputError(path, "no face of the OBJ file has an area")
    return vertices, triangles[has_area], np.resize(faces, len(triangles))[has_area]


def load_obj(path: Path) -> tuple[Array, Indices]:
    """Vertices (V, 3) in m and triangles (T, 3) of an OBJ file; InputError when there is nothing to draw."""
    vertices, triangles, _ = _loaded(path, mesh_text.read(path))
    return vertices, triangles


def load_painted(path: Path, folder: Path) -> tuple[Array, Indices, Array]:
    """As ``load_obj``, with the colour (T, 3) of each triangle; its materials are in the map's folder."""
    mesh = mesh_text.read(path)
    vertices, triangles, faces = _loaded(path, mesh)
    paints = mesh_text.paints(path, mesh, folder)
    files = {paint for paint, _ in paints if isinstance(paint, Path)}
    tiles = {file: Texture(load_picture(file), 0).tiles for file in files}
    pictures = {file: next(each for each in tiles[file] if max(each.shape) <= _PIXELS)[:, :, :3] for file in tiles}
    colours = [
        _shown(pictures[paint], spots) if isinstance(paint, Path) else np.array(paint[::-1]) * 255.0
        for paint, spots in paints
    ]
    return vertices, triangles, np.array(colours)[faces]


def _shown(picture: Image, spots: mesh_text.Spots) -> Array:
    """The mean colour of what a face shows of its texture; of all of it without texture coordinates."""
    if spots:
        within = np.array(spots) - np.floor(np.min(spots, axis=0))
        (left, low), (right, high) = within.min(axis=0), np.minimum(within.max(axis=0), 1.0)
        rows, columns = picture.shape[:2]
        top, first = min(int((1 - high) * rows), rows - 1), min(int(left * columns), columns - 1)
        picture = picture[top : max(int((1 - low) * rows), top + 1), first : max(int(right * columns), first + 1)]
    return np.asarray(picture.mean(axis=(0, 1)), np.float64)
