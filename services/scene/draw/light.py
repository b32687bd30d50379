"""Where the light comes from, and how bright it leaves a surface."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from services.scene.camera import Array

AMBIENT, DIFFUSE = 0.62, 0.38
DIRECTION = np.array([-0.35, -0.25, 0.9]) / np.linalg.norm([-0.35, -0.25, 0.9])
"""The direction towards the light, in the world, by default."""


def direction_of(azimuth: float, elevation: float) -> Array:
    """The unit vector (3,) at an azimuth, counter-clockwise from the world's x axis, and an elevation; in rad."""
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


@dataclass(frozen=True, eq=False)
class Light:
    """``direction`` (3,) points towards the light; ``on_blocks`` tells whether it shades blocks and the ground too.

    Without a chosen light a map's blocks are shown in their own colours.
    """

    direction: Array
    ambient: float
    diffuse: float
    on_blocks: bool

    @classmethod
    def usual(cls) -> Self:
        return cls(DIRECTION, AMBIENT, DIFFUSE, False)

    @classmethod
    def of_flags(cls, azimuth: float | None, elevation: float | None, ambient: float | None) -> Self:
        """From angles in deg and the share of light from everywhere; None for the usual value."""
        if azimuth is None and elevation is None and ambient is None:
            return cls.usual()
        x, y, z = DIRECTION.tolist()
        across = math.atan2(y, x) if azimuth is None else math.radians(azimuth)
        up = math.asin(z) if elevation is None else math.radians(elevation)
        share = AMBIENT if ambient is None else ambient
        return cls(direction_of(across, up), share, 1.0 - share, True)

    def shades(self, cosines: Array) -> Array:
        """Lambert's cosine law for the cosines of any shape between normals and the light."""
        return np.asarray(self.ambient + self.diffuse * np.maximum(cosines, 0.0), np.float64)

    def on(self, normal: Array) -> float:
        """The shade of a block's side with a unit ``normal`` (3,)."""
        return float(self.shades(normal @ self.direction)) if self.on_blocks else 1.0
