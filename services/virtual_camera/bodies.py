"""The models of a scene as seen from a place: culled, and the right drawing chosen for each copy."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from services.virtual_camera.bsp import Tree
from services.virtual_camera.camera import NEAR, Array, View
from services.virtual_camera.crowd import Crowd
from services.virtual_camera.light import Light
from services.virtual_camera.shading import Group, Piece, cut, gather, silhouettes, whole

SMALL = 8.0
"""Copies of a smaller radius, in pixels, are drawn as silhouettes."""
INVISIBLE = 0.3
"""Copies of a smaller radius, in pixels, are not drawn."""

Numbers = npt.NDArray[np.intp]
Drawn = tuple[int, list[Piece]]
"""The number of a body and its pieces."""

_DRAWINGS: list[Callable[[Group], list[list[Piece]]]] = [silhouettes, whole, cut]


class Bodies:
    """All copies of all models, in fixed order; ``tree`` says which region of space each stands in."""

    def __init__(self, crowds: tuple[Crowd, ...], tree: Tree, light: Light) -> None:
        self._crowds, self._light = crowds, light
        counts = [len(crowd.turns) for crowd in crowds]
        self._crowd = np.repeat(np.arange(len(crowds)), counts)
        self._member = np.concatenate([np.arange(0), *(np.arange(count) for count in counts)])
        self._radius = np.repeat([crowd.shape.radius for crowd in crowds], counts)
        self._middle = np.concatenate([np.zeros((0, 3)), *map(_middles, crowds)])
        self._leaf = tree.locate(self._middle)
        self.names = [crowd.name for crowd in crowds for _ in crowd.turns]
        """The model's name of each body."""

    def outline(self, body: int) -> tuple[Array, Numbers]:
        """A body's vertices (V, 3) in the world and its faces (F, 8) of vertex numbers."""
        crowd, member = self._crowds[self._crowd[body]], self._member[body]
        c, s = np.cos(crowd.turns[member]), np.sin(crowd.turns[member])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return crowd.shape.vertices @ turn.T + crowd.positions[member], crowd.shape.faces

    def pieces(self, view: View) -> dict[int, list[Drawn]]:
        """For each region with something to see, the bodies in it and their pieces to fill, from back to front."""
        place = view.to_camera(self._middle)
        seen = np.flatnonzero(self._in_sight(view, place))
        seen = seen[np.argsort(-(place[seen] ** 2).sum(axis=1), kind="stable")]
        drawing = self._drawing(view, place, seen)
        drawn: dict[int, list[Piece]] = {}
        for crowd, kind in sorted(set(zip(self._crowd[seen].tolist(), drawing.tolist(), strict=True))):
            these = seen[(self._crowd[seen] == crowd) & (drawing == kind)]
            bodies = _DRAWINGS[kind](self._group(view, crowd, these))
            drawn.update(zip(these.tolist(), bodies, strict=True))
        regions: dict[int, list[Drawn]] = {}
        for body in seen.tolist():
            regions.setdefault(int(self._leaf[body]), []).append((body, drawn[body]))
        return regions

    def _in_sight(self, view: View, place: Array) -> npt.NDArray[np.bool_]:
        inside = (place @ view.camera.sides.T > -self._radius[:, None]).all(axis=1)
        large = self._radius * view.camera.focal > INVISIBLE * place[:, 2]
        return np.asarray(inside & large & (place[:, 2] + self._radius > NEAR), np.bool_)

    def _drawing(self, view: View, place: Array, seen: Numbers) -> Numbers:
        depth, radius = place[seen, 2], self._radius[seen]
        small = radius * view.camera.focal < SMALL * depth
        return np.where(depth - radius <= NEAR, 2, np.where(small, 0, 1))

    def _group(self, view: View, crowd: int, bodies: Numbers) -> Group:
        which, members = self._crowds[crowd], self._member[bodies]
        return gather(view, which.shape, which.colour, which.positions[members], which.turns[members], self._light)


def _middles(crowd: Crowd) -> Array:
    """The middles (n, 3) of a crowd's bounding spheres, in the world."""
    x, y, z = crowd.shape.middle
    c, s = np.cos(crowd.turns), np.sin(crowd.turns)
    return np.asarray(crowd.positions + np.column_stack([c * x - s * y, s * x + c * y, np.full_like(c, z)]))
