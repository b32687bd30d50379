"""Range sensors: what they measure of the distances to what stands around them.

The ultrasonic one is a Devantech SRF08, the infrared one a Sharp GP2Y0A; ``README.md`` has their data sheets.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from services.scene.outlines import Array, Cut, Outlines, Place

Beyond = Literal["maximum", "zero", "silence"]


@dataclass(frozen=True)
class Curve:
    """The voltages (V) of an infrared sensor at distances (m), the nearest first, straight between them.

    Nearer than the first, what it sees leaves its detector: the voltage falls to 0 V at contact. Farther than the last,
    it falls with the distance.
    """

    distances: tuple[float, ...]
    voltages: tuple[float, ...]

    @classmethod
    def parse(cls, text: str) -> "Curve":
        """From ``V,m;V,m``, as OpenDLV's logic-distance-voltage has it; raises ValueError."""
        try:
            points = [tuple(float(number) for number in point.split(",")) for point in text.split(";") if point.strip()]
            volts, metres = zip(*((v, m) for v, m in points), strict=True)
        except ValueError:
            raise ValueError(f"--curve={text} is not a list of points V,m;V,m") from None
        if len(points) < 2 or not all(map(math.isfinite, (*volts, *metres))) or min(*volts, *metres) <= 0.0:
            raise ValueError(f"--curve={text} needs two points V,m or more, of numbers above 0")
        if list(volts) != sorted(set(volts), reverse=True) or list(metres) != sorted(set(metres)):
            raise ValueError(f"--curve={text} has to fall from the nearest distance to the farthest")
        return cls(metres, volts)

    def voltage(self, distance: float, near: float) -> float:
        """In V at a distance; ``near`` is where it begins to fall towards contact."""
        if distance < near:
            return self.voltage(near, 0.0) * distance / near
        if distance > self.distances[-1]:
            return self.voltages[-1] * self.distances[-1] / distance
        return float(np.interp(distance, self.distances, self.voltages))

    def distance(self, voltage: float) -> float:
        """In m, as the curve says, which knows nothing nearer or farther than its ends."""
        return float(np.interp(voltage, self.voltages[::-1], self.distances[::-1]))


@dataclass(frozen=True)
class Sensor:
    """Where a sensor is on the vehicle, in m and rad counter-clockwise from forward, and its readings' stamp."""

    stamp: int
    x: float = 0.0
    y: float = 0.0
    z: float = 0.1
    yaw: float = 0.0


@dataclass(frozen=True)
class Device:
    """What sensors of one kind have in common: opening angle (rad, up to pi), range (m) and errors.

    ``rays`` are those that fill the opening angle; with None the whole of it is looked at.
    ``curve`` is that of infrared sensors; ``in_volts`` whether they give voltages. ``noise`` is the standard deviation
    of the distance in m, ``outliers`` the share of wrong readings.
    """

    cone: float = 0.0
    rays: int | None = None
    near: float = 0.03
    far: float = 6.0
    beyond: Beyond = "maximum"
    curve: Curve | None = None
    in_volts: bool = False
    noise: float = 0.0
    outliers: float = 0.0

    def angles(self) -> Array:
        """The directions of its rays from its own, in rad; its own alone where the whole cone is looked at."""
        return np.linspace(-self.cone / 2, self.cone / 2, self.rays) if self.rays and self.rays > 1 else np.zeros(1)

    def reading(self, distance: float, errors: tuple[float, float, float]) -> float | None:
        """What it gives at a true distance (inf for nothing there), in m or V; None when it says nothing.

        ``errors`` are a number of the standard normal distribution and two from 0 to 1.
        """
        deviation, luck, where = errors
        if luck < self.outliers:
            distance = self.near + where * (self.far - self.near)
        elif distance <= self.far:
            distance = max(distance + self.noise * deviation, 0.0)
        if distance > self.far:
            if self.beyond != "maximum":
                return 0.0 if self.beyond == "zero" else None
            distance = self.far
        if self.curve is None:
            return max(distance, self.near)
        voltage = self.curve.voltage(distance, self.near)
        return voltage if self.in_volts else self.curve.distance(voltage)


class RangeFinder:
    def __init__(self, outlines: Outlines, sensors: Sequence[Sensor], device: Device, seed: int = 0) -> None:
        self._outlines, self.sensors, self.device = outlines, tuple(sensors), device
        self._random = [np.random.RandomState([seed, sensor.stamp]) for sensor in sensors]
        self._mounts = np.array([[sensor.x, sensor.y] for sensor in sensors])
        angles = np.array([sensor.yaw for sensor in sensors])[:, None] + device.angles()
        self._rays = np.stack([np.cos(angles), np.sin(angles)], axis=2)
        heights: dict[float, list[int]] = {}
        for number, sensor in enumerate(sensors):
            heights.setdefault(sensor.z, []).append(number)
        self._heights = {z: np.array(numbers) for z, numbers in heights.items()}

    def distances(self, vehicle: Place, bodies: Mapping[int, Place]) -> Array:
        """The true distance (m) from each sensor to what it sees: 0 inside something, inf when nothing is there.

        ``bodies`` are the places of models that move, by sender stamp.
        """
        c, s = math.cos(vehicle.yaw), math.sin(vehicle.yaw)
        turn = np.array([[c, s], [-s, c]])
        places, rays = self._mounts @ turn + np.array([vehicle.x, vehicle.y]), self._rays @ turn
        found = np.empty(len(self.sensors))
        for z, numbers in self._heights.items():
            cuts = self._cuts(vehicle.z + z, bodies)
            found[numbers] = self._nearest(cuts, places[numbers], rays[numbers])
        return found

    def readings(self, vehicle: Place, bodies: Mapping[int, Place]) -> list[float | None]:
        """What each sensor gives, in m or V; None of one that says nothing."""
        distances = self.distances(vehicle, bodies).tolist()
        errors = [(random.standard_normal(), *random.uniform(size=2).tolist()) for random in self._random]
        return [self.device.reading(d, e) for d, e in zip(distances, errors, strict=True)]

    def _cuts(self, height: float, bodies: Mapping[int, Place]) -> list[Cut]:
        return [self._outlines.at(height), *self._outlines.bodies_at(height, bodies)]

    def _nearest(self, cuts: Sequence[Cut], places: Array, rays: Array) -> Array:
        device, nearest = self.device, np.full(len(places), np.inf)
        origins, directions = np.repeat(places, rays.shape[1], axis=0), rays.reshape(-1, 2)
        for cut in cuts:
            if device.cone and device.rays is None:
                found = cut.nearest(origins, directions, device.cone / 2, device.far)
            else:
                found = cut.distances(origins, directions, device.far).reshape(len(places), -1).min(axis=1)
            nearest = np.minimum(nearest, np.where(cut.contains(places), 0.0, found))
        return nearest
