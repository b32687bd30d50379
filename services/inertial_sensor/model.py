"""What sensors on a moving body read: angular velocity, specific force, the magnetic field, and the place on earth.

SI units. Body: x forward, y left, z up; world: z up. Vectors are (3,), rotations (3, 3).
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.envelope import MICROSECONDS
from services.base import UnusableMessageError

Array = NDArray[np.float64]
_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])


def attitude(qx: float, qy: float, qz: float, qw: float) -> Array:
    """The rotation of a quaternion of any length from the body to the world; raises UnusableMessageError."""
    length = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(length) or length == 0.0:
        raise UnusableMessageError("it has no attitude")
    x, y, z, w = (each / length for each in (qx, qy, qz, qw))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class BodyState(NamedTuple):
    """Velocity (m/s) and angular velocity (rad/s) of a body along its axes, at a time in us."""

    time: int
    velocity: Array
    rates: Array


def _cross(a: Array, b: Array) -> Array:
    """As ``np.cross``, which takes ten times as long for one pair."""
    product: Array = a[_NEXT] * b[_AFTER] - a[_AFTER] * b[_NEXT]
    return product


def acceleration_of(before: BodyState, after: BodyState, lever: Array) -> Array:
    """The mean acceleration along the body's axes (m/s2) of a point at ``lever`` (m), from one state to another.

    With v and ω at the middle of both: v' + ω x v + ω' x l + ω x (ω x l).
    """
    per_second = MICROSECONDS / (after.time - before.time)
    velocity, rates = (before.velocity + after.velocity) / 2, (before.rates + after.rates) / 2
    slower, turning = per_second * (after.velocity - before.velocity), per_second * (after.rates - before.rates)
    around: Array = _cross(turning, lever) + _cross(rates, velocity + _cross(rates, lever))
    return slower + around


class InertialModel:
    """A sensor at ``lever`` (m) on a body, turned by ``mount``; it knows the body from the states that it is fed."""

    def __init__(self, lever: Array, mount: Array, gravity: float) -> None:
        self._lever, self._to_sensor = lever, mount.T
        self._upwards = np.array([0.0, 0.0, gravity])
        self._newest: BodyState | None = None
        self._used: BodyState | None = None
        self._acceleration = np.zeros(3)

    def feed(self, state: BodyState) -> None:
        """Take the body's state; one that is not newer than the last is ignored."""
        if self._newest is None or state.time > self._newest.time:
            self._newest = state

    def motion(self, body: Array) -> tuple[Array, Array] | None:
        """Angular velocity (rad/s) and specific force (m/s2) along the sensor's axes, with the body's attitude.

        The force is the mean since the state of the last reading. Before the second state the body's velocities are
        held, and before the first there is no motion.
        """
        newest = self._newest
        if newest is None:
            return None
        used = self._used or newest._replace(time=newest.time - 1)
        if newest.time > used.time:
            self._acceleration = acceleration_of(used, newest, self._lever)
        self._used = newest
        return self._to_sensor @ newest.rates, self._to_sensor @ (self._acceleration + body.T @ self._upwards)

    def direction(self, body: Array, world: Array) -> Array:
        """A vector of the world along the sensor's axes."""
        return np.asarray(self._to_sensor @ (body.T @ world), np.float64)

    def place(self, body: Array, position: Array) -> Array:
        """Where the sensor is in the world, in m."""
        return np.asarray(position + body @ self._lever, np.float64)


def magnetic_field(strength: float, inclination: float, declination: float, north: float) -> Array:
    """The earth's field in the world: so strong (T), so far below the horizon and east of north (rad).

    ``north`` is where north is, counter-clockwise from the world's x axis, in rad.
    """
    level, direction = strength * math.cos(inclination), north - declination
    return np.array([level * math.cos(direction), level * math.sin(direction), -strength * math.sin(inclination)])


EQUATOR, FLATTENING = 6_378_137.0, 1 / 298.257223563
"""WGS84: the larger half axis in m, and the flattening"""


@dataclass(frozen=True)
class Origin:
    """Where the world's origin is on earth: degrees and m; ``north`` in rad from its x axis, counter-clockwise."""

    latitude: float
    longitude: float
    altitude: float
    north: float

    def geolocation(self, place: Array, east: float = 0.0, north: float = 0.0) -> tuple[float, float, float]:
        """Latitude and longitude in degrees, altitude in m, of a place in m that is measured so far (m) beside it.

        On the plane that touches the ellipsoid at the origin: one radius along the meridian, one along the parallel.
        """
        x, y, z = place
        cosine, sine = math.cos(self.north), math.sin(self.north)
        to_north, to_east = x * cosine + y * sine + north, x * sine - y * cosine + east
        latitude = math.radians(self.latitude)
        squared = FLATTENING * (2 - FLATTENING)
        width = math.sqrt(1 - squared * math.sin(latitude) ** 2)
        along_meridian = EQUATOR * (1 - squared) / width**3 + self.altitude
        along_parallel = (EQUATOR / width + self.altitude) * math.cos(latitude)
        return (
            self.latitude + math.degrees(to_north / along_meridian),
            self.longitude + math.degrees(to_east / along_parallel),
            self.altitude + z,
        )

    def heading(self, angle: float) -> float:
        """Clockwise from north, 0 to 2π, of an angle counter-clockwise from the world's x axis, both in rad."""
        return (self.north - angle) % math.tau
