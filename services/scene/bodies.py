"""The models of a scene as seen from a place: culled, and the right drawing chosen for each copy.

They are drawn one after another, the farthest first, which is right as long as they do not intersect.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import FRAME_TURN
from services.scene.bsp import Tree
from services.scene.camera import NEAR, Array, View
from services.scene.shading import Group, Light, Piece, cut, gather, silhouettes, whole
from services.scene.shape import Shape


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


SMALL = 8.0
"""Copies of a smaller radius, in pixels, are drawn as silhouettes."""
INVISIBLE = 0.3
"""Copies of a smaller radius, in pixels, are not drawn."""

Numbers = npt.NDArray[np.intp]
Drawn = tuple[int, list[Piece]]

_DRAWINGS: list[Callable[[Group], list[list[Piece]]]] = [silhouettes, whole, cut]


class Bodies:
    """All copies of all models, those that move last; ``tree`` divides the space in which they stand."""

    def __init__(self, models: tuple[Copies, ...], tree: Tree, light: Light) -> None:
        self._models, self._light, self._tree = models, light, tree
        counts = [len(copies.turns) for copies in models]
        self._model = np.repeat(np.arange(len(models)), counts)
        self._member = np.concatenate([np.arange(0), *(np.arange(count) for count in counts)])
        self._radius = np.repeat([copies.shape.radius for copies in models], counts)
        self.middles = np.concatenate([np.zeros((0, 3)), *map(_middles, models)])
        """The middle (3,) of each body's bounding sphere, in the world."""
        self._leaf = tree.locate(self.middles)
        self.names = [copies.name for copies in models for _ in copies.turns]
        stamps = [stamp for copies in models for stamp in copies.stamps]
        first = len(self.names) - len(stamps)
        self._moving = {stamp: body for body, stamp in enumerate(stamps, first)}
        self._radius[first:] = 0.0

    @property
    def stamps(self) -> tuple[int, ...]:
        return tuple(self._moving)

    def place(self, stamp: int, position: Array, yaw: float) -> None:
        """What moves with the frames of a sender is at ``position`` (3,) in m, and looks along ``yaw`` in rad."""
        body = self._moving[stamp]
        copies, member = self._models[self._model[body]], self._member[body]
        copies.positions[member], copies.turns[member] = position, yaw + FRAME_TURN
        self._radius[body] = copies.shape.radius
        self.middles[body] = _middles(copies)[member]
        self._leaf[body] = self._tree.locate(self.middles[body : body + 1])[0]

    def outline(self, body: int) -> tuple[Array, Numbers]:
        """A body's vertices (V, 3) in the world and its faces (F, 8) of vertex numbers."""
        copies, member = self._models[self._model[body]], self._member[body]
        c, s = np.cos(copies.turns[member]), np.sin(copies.turns[member])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return copies.shape.vertices @ turn.T + copies.positions[member], copies.shape.faces

    def pieces(self, view: View) -> dict[int, list[Drawn]]:
        """For each region with something to see, the bodies in it and their pieces to fill, from back to front."""
        place = view.to_camera(self.middles)
        seen = np.flatnonzero(self._in_sight(view, place))
        seen = seen[np.argsort(-(place[seen] ** 2).sum(axis=1), kind="stable")]
        drawing = self._drawing(view, place, seen)
        drawn: dict[int, list[Piece]] = {}
        for model, kind in sorted(set(zip(self._model[seen].tolist(), drawing.tolist(), strict=True))):
            these = seen[(self._model[seen] == model) & (drawing == kind)]
            bodies = _DRAWINGS[kind](self._group(view, model, these))
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

    def _group(self, view: View, model: int, bodies: Numbers) -> Group:
        which, members = self._models[model], self._member[bodies]
        return gather(view, which.shape, which.colour, which.positions[members], which.turns[members], self._light)


def _middles(copies: Copies) -> Array:
    """The middles (n, 3) of the copies' bounding spheres, in the world."""
    x, y, z = copies.shape.middle
    c, s = np.cos(copies.turns), np.sin(copies.turns)
    return np.asarray(copies.positions + np.column_stack([c * x - s * y, s * x + c * y, np.full_like(c, z)]))
