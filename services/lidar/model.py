"""A planar lidar: what it measures of the distances around it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from services.scene.outlines import Array, Cut, Outlines, Place


@dataclass(frozen=True)
class Lidar:
    """Where it is on the vehicle, in m and rad counter-clockwise from forward, and how it looks around.

    ``rays`` fill the field of view (rad) at even angles; where that is a full turn, the last one is not the first one
    again. ``noise`` is the standard deviation of a distance in m, between ``near`` and ``far`` in m.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.1
    yaw: float = 0.0
    field_of_view: float = math.tau
    rays: int = 360
    near: float = 0.15
    far: float = 12.0
    noise: float = 0.0

    @property
    def increment(self) -> float:
        return self.field_of_view / (self.rays - (not math.isclose(self.field_of_view, math.tau)))


class Scanner:
    def __init__(self, outlines: Outlines, lidar: Lidar, seed: int = 0, stamp: int = 0) -> None:
        self._outlines, self.lidar = outlines, lidar
        self._random = np.random.RandomState([seed, stamp])
        self._angles = lidar.yaw - lidar.field_of_view / 2 + lidar.increment * np.arange(lidar.rays)

    def distances(self, vehicle: Place, bodies: Mapping[int, Place]) -> Array:
        """The true distance (m) along each ray: 0 inside something, inf where nothing is within ``far``.

        ``bodies`` are the places of models that move, by sender stamp.
        """
        lidar, (c, s) = self.lidar, (math.cos(vehicle.yaw), math.sin(vehicle.yaw))
        origin = np.array([vehicle.x + c * lidar.x - s * lidar.y, vehicle.y + s * lidar.x + c * lidar.y])
        angles, height = vehicle.yaw + self._angles, vehicle.z + lidar.z
        cut = Cut.joined([self._outlines.at(height), *self._outlines.bodies_at(height, bodies)])
        return cut.scan(origin, np.column_stack([np.cos(angles), np.sin(angles)]), lidar.increment, lidar.far)

    def ranges(self, vehicle: Place, bodies: Mapping[int, Place]) -> npt.NDArray[np.float32]:
        """What it measures, in m: inf where nothing is in range, -inf where it is too near, as REP 117 has it."""
        measured = self.distances(vehicle, bodies) + self.lidar.noise * self._random.standard_normal(self.lidar.rays)
        measured[measured > self.lidar.far] = np.inf
        measured[measured < self.lidar.near] = -np.inf
        return measured.astype(np.float32)
