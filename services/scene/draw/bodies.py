"""The models of a scene as seen from a place: culled, and the right drawing chosen for each copy."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from services.scene.camera import NEAR, Array, View
from services.scene.draw.bsp import Tree
from services.scene.draw.copies import Copies
from services.scene.draw.faces import Face
from services.scene.draw.light import Light
from services.scene.draw.shading import Group, Piece, cut, gather, silhouettes, whole
from services.scene.draw.solids import Solid, groups, make_solids, overlapping, pierced, too_large

SMALL = 8.0
"""Copies of a smaller radius, in pixels, are drawn as silhouettes."""
INVISIBLE = 0.3
"""Copies of a smaller radius, in pixels, are not drawn."""

Numbers = npt.NDArray[np.intp]
Drawn = tuple[int, list[Piece]]
"""The number of a body and its pieces."""

_DRAWINGS: list[Callable[[Group], list[list[Piece]]]] = [silhouettes, whole, cut]


class Bodies:
    """All copies of all models, in fixed order; ``tree`` divides the space in which they stand."""

    def __init__(self, models: tuple[Copies, ...], tree: Tree, light: Light, faces: Sequence[Face] = ()) -> None:
        self._models, self._light = models, light
        counts = [len(copies.turns) for copies in models]
        self._model = np.repeat(np.arange(len(models)), counts)
        self._member = np.concatenate([np.arange(0), *(np.arange(count) for count in counts)])
        self._radius = np.repeat([copies.shape.radius for copies in models], counts)
        self._middle = np.concatenate([np.zeros((0, 3)), *map(_middles, models)])
        self.middles = self._middle
        """The middle (3,) of each body's bounding sphere, in the world; solids, which come later, are none of these."""
        self._leaf = tree.locate(self._middle)
        self.names = [copies.name for copies in models for _ in copies.turns]
        """The model's name of each body."""
        self._solids = list(self._cut_up(tree, faces))
        self._append(self._solids)

    @property
    def solids(self) -> int:
        """How many solids stand in for bodies that intersect."""
        return len(self._solids)

    def _cut_up(self, tree: Tree, faces: Sequence[Face]) -> Iterator[Solid]:
        """Solids in place of the bodies that intersect; those bodies are not drawn any more."""

        def corners(body: int) -> Array:
            return self.outline(body)[0]

        bodies = pierced(faces, corners, self._middle, self._radius)
        for group in groups(bodies, overlapping(corners, self._middle, self._radius)):
            parts = [face for body in group for face in self._faces(body)]
            if not too_large(group, len(parts)):
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
        for corners in numbers.tolist():
            points = vertices[list(dict.fromkeys(corners))]
            normal = np.cross(points[1] - points[0], points[2] - points[0])
            normal /= np.linalg.norm(normal)
            lit = np.rint(np.minimum(copies.colour * self._light.shades(normal @ self._light.direction), 255.0))
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
