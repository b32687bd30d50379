"""Background clutter: boxes of all colours that stand around what a map holds, the same ones for the same seed."""

import numpy as np

from services.scene.camera import Array
from services.scene.draw.copies import Copies
from services.scene.draw.shape import Shape, make_shape

KINDS = 8
"""The most sizes and colours; boxes of a kind are drawn together."""
NEAREST, FARTHEST = 0.5, 3.0
"""How far from the rectangle around all models the boxes stand, in m."""
_SIDES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def _box(width: float, depth: float, height: float) -> Shape:
    x, y = width / 2, depth / 2
    low = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]
    vertices = np.array(low + [[a, b, height] for a, b, _ in low])
    triangles = np.concatenate([_SIDES[:, [0, 1, 2]], _SIDES[:, [0, 2, 3]]])
    return make_shape(vertices, triangles)


def _extent(models: tuple[Copies, ...]) -> tuple[Array, Array]:
    places = [copies.positions[:, :2] for copies in models]
    if not places:
        return np.zeros(2), np.zeros(2)
    everything = np.concatenate(places)
    return everything.min(axis=0), everything.max(axis=0)


def _places(random: np.random.RandomState, count: int, low: Array, high: Array) -> Array:
    """Points (count, 3) on z = 0, spread along the rectangle around low and high, some way off it."""
    reach = random.uniform(NEAREST, FARTHEST, count)
    size = high - low
    along = random.uniform(0, 1, count) * 2 * (size.sum() + 4 * FARTHEST)
    lengths = np.array([size[0], size[1], size[0], size[1]]) + 2 * FARTHEST
    side = np.minimum(np.searchsorted(np.cumsum(lengths), along, side="right"), 3)
    offset = along - np.concatenate([[0.0], np.cumsum(lengths)])[side] - FARTHEST
    x = np.choose(side, [low[0] + offset, high[0] + reach, high[0] - offset, low[0] - reach])
    y = np.choose(side, [low[1] - reach, low[1] + offset, high[1] + reach, high[1] - offset])
    return np.column_stack([x, y, np.zeros(count)])


def clutter(count: int, seed: int, around: tuple[Copies, ...]) -> tuple[Copies, ...]:
    """``count`` boxes outside the rectangle that holds all models ``around``; none of them has a name."""
    if count == 0:
        return ()
    random = np.random.RandomState([2902, seed])
    places = _places(random, count, *_extent(around))
    turns = random.uniform(0, np.pi, count)
    models = []
    for kind in range(min(KINDS, count)):
        sizes, colour = random.uniform([0.06, 0.06, 0.06], [0.6, 0.6, 0.9]), random.uniform(10, 250, 3)
        members = np.arange(kind, count, KINDS)
        models.append(Copies(_box(*sizes.tolist()), colour, places[members], turns[members]))
    return tuple(models)
