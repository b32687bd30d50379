"""Lens distortion by Brown and Conrady's polynomial: where a real lens puts what the ideal pinhole sees.

With x, y a point of the camera frame at depth 1 and r2 = x2 + y2, the lens shows it at
x (1 + k1 r2 + k2 r4) + 2 p1 xy + p2 (r2 + 2 x2), and y likewise with p1 (r2 + 2 y2) + 2 p2 xy, as OpenCV has it.
"""

import math
from dataclasses import astuple, dataclass

import cv2
import numpy as np

from services.virtual_camera.camera import Array, Pinhole
from services.virtual_camera.draw.raster import Image

_STEPS = 60
_CLOSE = 0.02
_WIDEST = 2.5


@dataclass(frozen=True)
class Distortion:
    """Coefficients without units; all zero is the ideal pinhole. A negative ``k1`` makes a barrel."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def __bool__(self) -> bool:
        return any(astuple(self))

    def shifted(self, ideal: Array) -> tuple[Array, Array]:
        """The radial factor (...,) and the tangential offset (..., 2) for points (..., 2) at depth 1."""
        x, y = ideal[..., 0], ideal[..., 1]
        r2 = x * x + y * y
        offset = np.stack(
            [
                2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
                self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y,
            ],
            axis=-1,
        )
        return 1 + self.k1 * r2 + self.k2 * r2 * r2, offset

    def forward(self, ideal: Array) -> Array:
        """Where the lens shows points (..., 2) at depth 1."""
        factor, offset = self.shifted(ideal)
        return np.asarray(ideal * factor[..., None] + offset, np.float64)

    def backward(self, shown: Array) -> Array:
        """Which points (..., 2) the lens shows at these; NaN where it shows nothing."""
        ideal = shown
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                factor, offset = self.shifted(ideal)
                ideal = (shown - offset) / factor[..., None]
        return np.asarray(ideal, np.float64)


class Lens:
    """Turns pictures of a larger ideal camera, ``wide``, into what ``camera`` sees through a lens."""

    def __init__(self, camera: Pinhole, distortion: Distortion) -> None:
        """ValueError when the coefficients fold the picture or need far more than it shows."""
        self.camera, self._distortion = camera, distortion
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
        shown = (np.stack([u, v], axis=-1) - camera.centre) / camera.focal
        ideal = distortion.backward(shown)
        with np.errstate(all="ignore"):
            missed = np.abs(distortion.forward(ideal) - shown).max() * camera.focal
        half = np.abs(ideal).max(axis=(0, 1)) * camera.focal + 1.5
        if not missed < _CLOSE or not (half < _WIDEST * np.array([camera.width, camera.height]) / 2 + 2).all():
            raise ValueError(
                "the lens distortion is too strong: it folds the picture, or needs one more than 2.5 as wide"
            )
        width, height = (
            2 * max(math.ceil(a), b // 2) for a, b in zip(half, (camera.width, camera.height), strict=True)
        )
        self.wide = Pinhole(width, height, 2 * math.atan(height / 2 / camera.focal))
        spots = (ideal * camera.focal + self.wide.centre).astype(np.float32)
        self._maps = cv2.convertMaps(spots[..., 0], spots[..., 1], cv2.CV_16SC2)

    def apply(self, picture: Image, out: Image) -> None:
        """What the lens makes of a picture of ``wide``; ``out`` has the size of the camera's."""
        places, parts = self._maps
        cv2.remap(picture, places, parts, cv2.INTER_LINEAR, dst=out, borderMode=cv2.BORDER_REPLICATE)

    def shown(self, ideal: Array) -> Array:
        """Picture coordinates (..., 2) of the camera for those of ``wide``."""
        points = (ideal - self.wide.centre) / self.wide.focal
        return np.asarray(self._distortion.forward(points) * self.camera.focal + self.camera.centre, np.float64)
