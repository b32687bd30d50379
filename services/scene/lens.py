"""A real camera's lens and the place of its sensor: where it puts what the ideal pinhole sees.

With x, y a point of the camera frame at depth 1 and r2 = x2 + y2, the lens shows it at
x (1 + k1 r2 + k2 r4) + 2 p1 xy + p2 (r2 + 2 x2), and y likewise with p1 (r2 + 2 y2) + 2 p2 xy, by the polynomial of
Brown and Conrady, as OpenCV has it. That is at u = fx x + cx and v = fy y + cy of the picture.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from services.base import Flags
from services.scene.camera import Array, Pinhole
from services.scene.raster import Image

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
        """Which points (..., 2) the lens shows at these; NaN if it shows nothing."""
        ideal = shown
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                factor, offset = self.shifted(ideal)
                ideal = (shown - offset) / factor[..., None]
        return np.asarray(ideal, np.float64)


@dataclass(frozen=True)
class Alignment:
    """How the sensor lies behind the lens, in pixels; None is as in an ideal camera.

    ``focal_x`` is the focal length along the picture's width, ``centre_x`` and ``centre_y`` where the optical axis
    meets the picture: fx, cx and cy of OpenCV's camera matrix.
    """

    focal_x: float | None = None
    centre_x: float | None = None
    centre_y: float | None = None

    def of(self, camera: Pinhole) -> tuple[Array, Array]:
        """Focal lengths (2,) and centre (2,) in a picture of ``camera``, whose focal length along the height stays."""
        focal = np.array([camera.focal if self.focal_x is None else self.focal_x, camera.focal])
        written = zip((self.centre_x, self.centre_y), camera.centre, strict=True)
        return focal, np.array([middle if value is None else value for value, middle in written])


def camera_of(flags: Flags) -> "tuple[Pinhole, Lens | None]":
    """The camera by a service's flags, and its lens if it is not ideal; raises ValueError as Lens does."""
    camera = Pinhole(flags["width"], flags["height"], math.radians(flags["fovy"]))
    distortion = Distortion(*(flags[f"distortion.{name}"] for name in ("k1", "k2", "p1", "p2")))
    alignment = Alignment(*(flags[name] for name in ("focal-x", "centre-x", "centre-y")))
    is_ideal = distortion == Distortion() and alignment == Alignment()
    return camera, None if is_ideal else Lens(camera, distortion, alignment)


class Lens:
    """Turns pictures of a larger ideal camera, ``wide``, into what ``camera`` sees through a lens."""

    def __init__(self, camera: Pinhole, distortion: Distortion, alignment: Alignment = Alignment()) -> None:
        """ValueError when the coefficients fold the picture or need far more than it shows."""
        self.camera, self._distortion = camera, distortion
        self._focal, self._centre = alignment.of(camera)
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64)
        shown = (np.stack([u, v], axis=-1) - self._centre) / self._focal
        ideal = distortion.backward(shown)
        with np.errstate(all="ignore"):
            missed = np.abs(distortion.forward(ideal) - shown).max() * camera.focal
        half = np.abs(ideal).max(axis=(0, 1)) * camera.focal + 1.5
        if not missed < _CLOSE or not (half < _WIDEST * np.array([camera.width, camera.height]) / 2 + 2).all():
            raise ValueError(
                "the lens is too far from an ideal one: its distortion folds the picture, or with focal-x and the "
                "centre needs one more than 2.5 times as wide"
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
        return np.asarray(self._distortion.forward(points) * self._focal + self._centre, np.float64)
