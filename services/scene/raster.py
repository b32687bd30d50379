"""Filling convex polygons with OpenCV so that exactly what they cover is filled.

OpenCV also draws a polygon's outline, which makes it half a pixel wider on each side; polygons are
therefore made smaller by as much before they are filled.
"""

import math
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from services.scene.camera import Array

Image = npt.NDArray[np.uint8]
Canvas = Image | npt.NDArray[np.int32]
Fixed = npt.NDArray[np.int32]
Colour = tuple[float, ...]

SHIFT = 8
HALF_PIXEL = 0.48
OVERLAPPING = 0.3
"""How far pieces of one face are moved in: less than half a pixel, so that no gap stays between them."""


def fixed(points: Array) -> Fixed:
    """Picture coordinates as OpenCV's fixed point numbers of 1/256 pixel."""
    return np.rint(points * (1 << SHIFT)).astype(np.int32)


def fill_fixed(image: Canvas, points: Fixed, colour: Colour) -> None:
    cv2.fillConvexPoly(image, points, colour, cv2.LINE_8, SHIFT)


def inset(polygon: Array, amount: float = HALF_PIXEL) -> Array:
    """A convex polygon (k, 2) with every edge moved inwards, by less where it is too thin for that.

    Plain numbers, as calls of numpy take longer than a few corners do.
    """
    corners: list[list[float]] = polygon.tolist()
    edges = [(x, y, nx - x, ny - y) for (x, y), (nx, ny) in pairwise([*corners, corners[0]])]
    lengths = [math.hypot(along, up) for _, _, along, up in edges]
    doubled, perimeter = sum(x * up - y * along for x, y, along, up in edges), sum(lengths)
    if perimeter == 0.0 or doubled == 0.0:
        return polygon
    amount = min(amount, 0.45 * abs(doubled) / perimeter)
    side = math.copysign(1.0, doubled)
    for (x, y, along, up), length in zip(edges, lengths, strict=True):
        if length > 1e-9:
            across, down = -side * up / length, side * along / length
            corners = _cut(corners, across, down, -(across * x + down * y) - amount)
    return np.array(corners, np.float64).reshape(-1, 2)


def _cut(corners: list[list[float]], across: float, down: float, offset: float) -> list[list[float]]:
    """The part of a convex polygon where ``across * x + down * y + offset >= 0``, as ``clip``."""
    distances = [across * x + down * y + offset for x, y in corners]
    if not corners or min(distances) >= 0.0:
        return corners
    kept = []
    (last_x, last_y), was = corners[-1], distances[-1]
    for (x, y), now in zip(corners, distances, strict=True):
        if (was >= 0.0) != (now >= 0.0):
            t = was / (was - now)
            kept.append([last_x + t * (x - last_x), last_y + t * (y - last_y)])
        if now >= 0.0:
            kept.append([x, y])
        last_x, last_y, was = x, y, now
    return kept


def fill(image: Canvas, polygon: Array, colour: Colour, amount: float = HALF_PIXEL) -> None:
    """Fills the pixels whose centres lie in a convex polygon (k, 2) given in picture coordinates."""
    if len(polygon) > 2:
        fill_fixed(image, fixed(inset(polygon, amount)), colour)
