"""What was drawn from one place, moved to where it is seen from another close to it.

Models move as wholes, by the shift and the scale of the middle of each. While a shutter is open that cannot be told
from a new drawing, and saves culling, shading and sorting once more.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from services.scene.camera import NEAR, Array, View
from services.scene.draw.raster import SHIFT, Colour, Fixed
from services.scene.draw.shading import Piece

_ONE = 1 << SHIFT


class Movable:
    """Pieces of bodies as seen from one place, that can be seen from others."""

    def __init__(self, view: View, middles: Array, drawn: Sequence[tuple[int, list[Piece]]]) -> None:
        """``middles`` (n, 3) in the world, by the number of the body; ``drawn`` from back to front."""
        pieces = [piece for _, body in drawn for piece in body]
        corners = [len(points) for points, _ in pieces]
        self._ends = np.cumsum([0, *corners]).tolist()
        self._colours: list[Colour] = [colour for _, colour in pieces]
        self._points = np.concatenate([np.zeros((0, 2)), *(points.reshape(-1, 2) for points, _ in pieces)])
        self._counts = [len(body) for _, body in drawn]
        owners = np.repeat([body for body, _ in drawn], self._counts).astype(np.intp)
        self._owners = np.repeat(owners, np.array(corners, np.intp))
        self._middles = middles
        self._place = view.to_camera(middles)

    def seen_from(self, view: View) -> Iterator[list[Piece]]:
        """The pieces of each body, in the same order; a body whose middle is not before the camera stays."""
        place, before = view.to_camera(self._middles), self._place
        known = (place[:, 2] > NEAR) & (before[:, 2] > NEAR)
        size, shift = np.ones((len(place), 1)), np.zeros((len(place), 2))
        size[known] = before[known, 2:] / place[known, 2:]
        old, new = (view.camera.project(points[known]) for points in (before, place))
        shift[known] = (new - old * size[known]) * _ONE
        moved: Fixed = np.rint(self._points * size[self._owners] + shift[self._owners]).astype(np.int32)
        points = [moved[start:end] for start, end in zip(self._ends, self._ends[1:], strict=False)]
        pieces = iter(zip(points, self._colours, strict=True))
        for count in self._counts:
            yield [next(pieces) for _ in range(count)]
