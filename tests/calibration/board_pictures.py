"""Pictures of the board by a camera that is known: a projection of its own, with OpenCV's model of the lens."""

import functools
import math
from typing import Any

import cv2
import numpy as np

from dodo_dsl.run.rigs import calibration

WIDTH, HEIGHT, FACTOR = 640, 480, 2
MATRIX = np.array([[530.0, 0.0, 325.0], [0.0, 528.0, 236.0], [0.0, 0.0, 1.0]])
LENS = np.array([-0.12, 0.05, 0.001, -0.0008, 0.0])
POSES = [
    (a, b, x, y)
    for a, b, x, y in (
        (0, 0, 0, 0), (30, 0, -0.06, 0.03), (-30, 0, 0.06, -0.03), (0, 35, 0.07, 0.04), (0, -35, -0.07, -0.04),
        (25, 25, -0.05, -0.04), (-25, 25, 0.05, 0.04), (25, -25, 0.06, -0.04), (-25, -25, -0.06, 0.04),
    )
]  # fmt: skip
"""Tilts in degrees, and where the board's middle is in m."""


@functools.cache
def pictures() -> list[Any]:
    """The board as this camera sees it, in grey."""
    rays = _rays()
    return [_picture(rays, *pose) for pose in POSES]


def _rays() -> Any:
    """Of two by two places in each pixel, at depth 1."""
    v, u = np.mgrid[0 : HEIGHT * FACTOR, 0 : WIDTH * FACTOR].astype(np.float64)
    points = np.stack([(u + 0.5) / FACTOR - 0.5, (v + 0.5) / FACTOR - 0.5], axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(points, MATRIX, LENS).reshape(-1, 2)
    return np.concatenate([rays, np.ones((len(rays), 1))], axis=1)


def _picture(rays: Any, a: float, b: float, x: float, y: float) -> Any:
    """Each pixel's ray meets the board's plane in a place of the board, whose colour it has."""
    drawn = calibration.board().generateImage((9 * 28 * 4, 6 * 28 * 4))
    rotation, _ = cv2.Rodrigues(np.array([math.radians(a), math.radians(b), 0.0]))
    middle = np.array([x, y, 0.28])
    normal = rotation[:, 2]
    met = rays * (normal @ middle / (rays @ normal))[:, None] - middle
    place = (met @ rotation)[:, :2] * 4000 + np.array(drawn.shape[::-1]) / 2 - 0.5
    maps = place.astype(np.float32).reshape(HEIGHT * FACTOR, WIDTH * FACTOR, 2)
    seen = cv2.remap(drawn, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=235)
    return cv2.resize(seen, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
