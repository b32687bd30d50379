"""Filling convex polygons with OpenCV so that exactly what they cover is filled.

OpenCV also draws a polygon's outline, which makes it half a pixel wider on each side; polygons are
therefore made smaller by as much before they are filled.
"""

import cv2
import numpy as np
import numpy.typing as npt

from services.virtual_camera.camera import Array, clip

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
    """A convex polygon (k, 2) with every edge moved inwards, by less where it is too thin for that."""
    following = np.concatenate([polygon[1:], polygon[:1]])
    edges = following - polygon
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    doubled = float(np.sum(polygon[:, 0] * following[:, 1] - following[:, 0] * polygon[:, 1]))
    perimeter = float(lengths.sum())
    if perimeter == 0.0 or doubled == 0.0:
        return polygon
    amount = min(amount, 0.45 * abs(doubled) / perimeter)
    inwards = np.sign(doubled) * np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    for start, normal, length in zip(polygon, inwards, lengths, strict=True):
        if length > 1e-9:
            unit = normal / length
            polygon = clip(polygon, unit, -float(unit @ start) - amount)
    return polygon


def fill(image: Canvas, polygon: Array, colour: Colour, amount: float = HALF_PIXEL) -> None:
    """Fills the pixels whose centres lie in a convex polygon (k, 2) given in picture coordinates."""
    if len(polygon) > 2:
        fill_fixed(image, fixed(inset(polygon, amount)), colour)
