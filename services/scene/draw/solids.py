"""Models that stick into one another or into a block: their faces are cut up so that they hide one another rightly.

All other models are drawn one after another, the farthest first, which is right as long as they do not intersect.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from services.scene.camera import Array, View
from services.scene.draw.bsp import Tree
from services.scene.draw.faces import Face
from services.scene.draw.raster import OVERLAPPING, fixed, inset
from services.scene.draw.shading import Piece

MAX_FACES = 300
"""Groups of more faces are drawn as models that do not intersect."""
_TOUCH = 0.02
_LEAST = 0.0005
_AXES = np.array(
    [[np.cos(a), np.sin(a), 0.0] for a in np.arange(8) * np.pi / 8]
    + [[0.0, 0.0, 1.0]]
    + [[np.cos(a), np.sin(a), s] for a in np.arange(4) * np.pi / 4 for s in (1.0, -1.0)]
)

_log = logging.getLogger(__name__)
Corners = Callable[[int], Array]
"""The corners (V, 3) of a body in the world."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Faces in one region (leaf) of space, in the order in which they hide one another; each knows whose it is."""

    tree: Tree
    leaf: int
    middle: Array
    radius: float

    def pieces(self, view: View) -> Iterator[tuple[int, list[Piece]]]:
        """What of the faces shows their front in the picture, from back to front, each with its body."""
        for face in self.tree.back_to_front(view.position):
            if isinstance(face, Face) and isinstance(face.paint, tuple):
                visible = view.visible_part(view.to_camera(face.points))
                if len(visible) > 2:
                    yield face.owner, [(fixed(inset(view.camera.project(visible), OVERLAPPING)), face.paint)]


def overlapping(corners: Corners, middles: Array, radii: Array) -> list[tuple[int, int]]:
    """Pairs of bodies, given by their corners and spheres, that no plane of 17 directions keeps apart."""
    order = np.argsort(middles[:, 0] - radii, kind="stable")
    low, high = (middles[:, 0] - radii)[order], (middles[:, 0] + radii)[order]
    ends = np.searchsorted(low, high)
    spans: dict[int, tuple[Array, Array]] = {}

    def span(body: int) -> tuple[Array, Array]:
        if body not in spans:
            along = corners(body) @ _AXES.T
            spans[body] = along.min(axis=0), along.max(axis=0)
        return spans[body]

    pairs = []
    for i in np.flatnonzero(ends > np.arange(len(order)) + 1).tolist():
        others, one = order[i + 1 : ends[i]], int(order[i])
        near = ((middles[others] - middles[one]) ** 2).sum(axis=1) < (radii[others] + radii[one]) ** 2
        for other in others[near].tolist():
            (a, b), (c, d) = span(one), span(other)
            if (np.minimum(b, d) - np.maximum(a, c) > 1e-6).all():
                pairs.append((one, other))
    return pairs


def pierced(faces: Sequence[Face], corners: Corners, middles: Array, radii: Array) -> set[int]:
    """Bodies that stick through a face by more than a fiftieth of their size."""
    found: set[int] = set()
    for face in faces:
        off = middles @ face.normal - face.offset
        for body in np.flatnonzero(np.abs(off) < radii).tolist():
            distances = corners(body) @ face.normal - face.offset
            reach = max(_TOUCH * float(radii[body]), _LEAST)
            if distances.min() < -reach and distances.max() > reach and _near(face, middles[body], float(radii[body])):
                found.add(body)
    return found


def _near(face: Face, place: Array, radius: float) -> bool:
    """Whether a sphere may touch a face, as far as the planes through its edges tell."""
    edges = np.roll(face.points, -1, axis=0) - face.points
    sides = np.cross(face.normal, edges)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    heights = np.einsum("ij,ij->i", sides, place - face.points)
    return bool((heights > -radius).all() or (heights < radius).all())


def groups(bodies: set[int], pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Bodies that have to be cut up, those that are linked by pairs together, in order."""
    linked: dict[int, set[int]] = {body: {body} for body in bodies}
    for one, other in pairs:
        merged = linked.get(one, {one}) | linked.get(other, {other})
        linked.update(dict.fromkeys(merged, merged))
    return sorted({min(group): sorted(group) for group in linked.values()}.values())


def make_solids(faces: list[Face], tree: Tree) -> Iterator[Solid]:
    """One solid for each region of the tree that a group's faces reach into."""
    for leaf, parts in sorted(tree.distribute(faces).items()):
        points = np.concatenate([face.points for face in parts])
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        yield Solid(Tree(parts, by_area=False), leaf, middle, float(np.linalg.norm(points - middle, axis=1).max()))


def too_large(group: list[int], count: int) -> bool:
    """Whether a group has too many faces to be cut up, which is logged."""
    if count > MAX_FACES:
        _log.warning("%d models that intersect have %d faces, more than %d: not cut up", len(group), count, MAX_FACES)
    return count > MAX_FACES
