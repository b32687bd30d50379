"""The models of a scene as seen from a place: culled, and the right drawing chosen for each copy.

Models that stick into one another or into a block are solids: their faces are cut up so that they hide one another
rightly. All others are drawn one after another, the farthest first, which is right as long as they do not intersect.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import FRAME_TURN
from services.scene.bsp import Tree
from services.scene.camera import NEAR, Array, View
from services.scene.raster import OVERLAPPING, fixed, inset
from services.scene.shading import Group, Light, Piece, cut, gather, silhouettes, whole
from services.scene.shape import Shape
from services.scene.surfaces import Face


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of one shape: ``positions`` (n, 3) in m, ``turns`` (n,) in rad counter-clockwise about z.

    ``name`` is the model's in the map; scenery has none, and no boxes. Copies with ``stamps`` (n,) move: they are where
    ``Bodies.place`` puts them, and nowhere before.
    """

    shape: Shape
    colour: Array
    """Blue, green, red from 0 to 255: (3,), or (F, 3) of the faces."""
    positions: Array
    turns: Array
    name: str = ""
    stamps: tuple[int, ...] = ()


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
    """Whether a sphere may touch a face, as far as the planes through its edges show."""
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


SMALL = 8.0
"""Copies of a smaller radius, in pixels, are drawn as silhouettes."""
INVISIBLE = 0.3
"""Copies of a smaller radius, in pixels, are not drawn."""

Numbers = npt.NDArray[np.intp]
Drawn = tuple[int, list[Piece]]

_DRAWINGS: list[Callable[[Group], list[list[Piece]]]] = [silhouettes, whole, cut]


class Bodies:
    """All copies of all models, in fixed order; ``tree`` divides the space in which they stand.

    Those that move come last, and are never cut up: where they stick into something, the nearer hides the farther.
    """

    def __init__(self, models: tuple[Copies, ...], tree: Tree, light: Light, faces: Sequence[Face] = ()) -> None:
        self._models, self._light, self._tree = models, light, tree
        counts = [len(copies.turns) for copies in models]
        self._model = np.repeat(np.arange(len(models)), counts)
        self._member = np.concatenate([np.arange(0), *(np.arange(count) for count in counts)])
        self._radius = np.repeat([copies.shape.radius for copies in models], counts)
        self._middle = np.concatenate([np.zeros((0, 3)), *map(_middles, models)])
        self.middles = self._middle
        """The middle (3,) of each body's bounding sphere, in the world; solids, which come later, are none of these."""
        self._leaf = tree.locate(self._middle)
        self.names = [copies.name for copies in models for _ in copies.turns]
        stamps = [copies.stamps for copies in models if copies.stamps]
        first = len(self.names) - sum(map(len, stamps))
        self._moving = {stamp: first + n for n, stamp in enumerate(stamp for each in stamps for stamp in each)}
        self._radius[first:] = 0.0
        self._solids = list(self._cut_up(tree, faces, first))
        self._append(self._solids)

    @property
    def solids(self) -> int:
        """How many solids stand in for bodies that intersect."""
        return len(self._solids)

    @property
    def stamps(self) -> tuple[int, ...]:
        return tuple(self._moving)

    def place(self, stamp: int, position: Array, yaw: float) -> None:
        """What moves with the frames of a sender is at ``position`` (3,) in m, and looks along ``yaw`` in rad."""
        body = self._moving[stamp]
        copies, member = self._models[self._model[body]], self._member[body]
        copies.positions[member], copies.turns[member] = position, yaw + FRAME_TURN
        self._radius[body] = copies.shape.radius
        self._middle[body] = self.middles[body] = _middles(copies)[member]
        self._leaf[body] = self._tree.locate(self._middle[body : body + 1])[0]

    def _cut_up(self, tree: Tree, faces: Sequence[Face], count: int) -> Iterator[Solid]:
        """Solids in place of those of the first bodies that intersect; those are not drawn any more."""

        def corners(body: int) -> Array:
            return self.outline(body)[0]

        middles, radii = self._middle[:count], self._radius[:count]
        bodies = pierced(faces, corners, middles, radii)
        for group in groups(bodies, overlapping(corners, middles, radii)):
            parts = [face for body in group for face in self._faces(body)]
            if len(parts) > MAX_FACES:
                _log.warning("%d models that intersect have %d faces, too many to be cut up", len(group), len(parts))
            else:
                self._radius[group] = 0.0
                yield from make_solids(parts, tree)

    def _append(self, solids: list[Solid]) -> None:
        """Solids are culled and sorted as bodies are."""
        count = len(solids)
        self._model = np.concatenate([self._model, np.full(count, len(self._models))])
        self._member = np.concatenate([self._member, np.arange(count)])
        self._radius = np.concatenate([self._radius, np.array([solid.radius for solid in solids])])
        self._middle = np.concatenate([self._middle, np.array([s.middle for s in solids]).reshape(-1, 3)])
        self._leaf = np.concatenate([self._leaf, np.array([s.leaf for s in solids], np.intp)])

    def _faces(self, body: int) -> Iterator[Face]:
        """The faces of a body in the world, shaded."""
        copies, (vertices, numbers) = self._models[self._model[body]], self.outline(body)
        colours = np.broadcast_to(copies.colour, (len(numbers), 3))
        for corners, colour in zip(numbers.tolist(), colours, strict=True):
            points = vertices[list(dict.fromkeys(corners))]
            normal = np.cross(points[1] - points[0], points[2] - points[0])
            normal /= np.linalg.norm(normal)
            lit = np.rint(np.minimum(colour * self._light.shades(normal @ self._light.direction), 255.0))
            yield Face(points, normal, float(normal @ points[0]), (*lit.tolist(), 255.0), body)

    def outline(self, body: int) -> tuple[Array, Numbers]:
        """A body's vertices (V, 3) in the world and its faces (F, 8) of vertex numbers."""
        copies, member = self._models[self._model[body]], self._member[body]
        c, s = np.cos(copies.turns[member]), np.sin(copies.turns[member])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return copies.shape.vertices @ turn.T + copies.positions[member], copies.shape.faces

    def pieces(self, view: View) -> dict[int, list[Drawn]]:
        """For each region with something to see, the bodies in it and their pieces to fill, from back to front."""
        place = view.to_camera(self._middle)
        seen = np.flatnonzero(self._in_sight(view, place))
        seen = seen[np.argsort(-(place[seen] ** 2).sum(axis=1), kind="stable")]
        drawing = self._drawing(view, place, seen)
        drawn: dict[int, list[Piece]] = {}
        for model, kind in sorted(set(zip(self._model[seen].tolist(), drawing.tolist(), strict=True))):
            if model == len(self._models):
                continue
            these = seen[(self._model[seen] == model) & (drawing == kind)]
            bodies = _DRAWINGS[kind](self._group(view, model, these))
            drawn.update(zip(these.tolist(), bodies, strict=True))
        regions: dict[int, list[Drawn]] = {}
        for body in seen.tolist():
            own = [(body, drawn[body])] if body in drawn else self._solids[self._member[body]].pieces(view)
            regions.setdefault(int(self._leaf[body]), []).extend(own)
        return regions

    def _in_sight(self, view: View, place: Array) -> npt.NDArray[np.bool_]:
        inside = (place @ view.camera.sides.T > -self._radius[:, None]).all(axis=1)
        large = self._radius * view.camera.focal > INVISIBLE * place[:, 2]
        return np.asarray(inside & large & (place[:, 2] + self._radius > NEAR), np.bool_)

    def _drawing(self, view: View, place: Array, seen: Numbers) -> Numbers:
        depth, radius = place[seen, 2], self._radius[seen]
        small = radius * view.camera.focal < SMALL * depth
        return np.where(depth - radius <= NEAR, 2, np.where(small, 0, 1))

    def _group(self, view: View, model: int, bodies: Numbers) -> Group:
        which, members = self._models[model], self._member[bodies]
        return gather(view, which.shape, which.colour, which.positions[members], which.turns[members], self._light)


def _middles(copies: Copies) -> Array:
    """The middles (n, 3) of the copies' bounding spheres, in the world."""
    x, y, z = copies.shape.middle
    c, s = np.cos(copies.turns), np.sin(copies.turns)
    return np.asarray(copies.positions + np.column_stack([c * x - s * y, s * x + c * y, np.full_like(c, z)]))
