"""What sensors on a moving body read: angular velocity, specific force, the magnetic field, and the place on earth.

SI units. Body: x forward, y left, z up; world: z up. Vectors are tuples, and rotations matrices as three rows.
"""

import math
from dataclasses import dataclass

from dodo_dsl.opendlv.attitude import Matrix, Vector, cross, rotation_of
from dodo_dsl.opendlv.envelope import MICROSECONDS

ZERO: Vector = (0.0, 0.0, 0.0)
UPRIGHT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def turned(matrix: Matrix, v: Vector) -> Vector:
    """The vector in the frame that the rotation turns it to."""
    a, b, c = (sum(m * e for m, e in zip(row, v, strict=True)) for row in matrix)
    return a, b, c


def inverse(matrix: Matrix) -> Matrix:
    """The rotation back."""
    a, b, c = zip(*matrix, strict=True)
    return a, b, c


def attitude(qx: float, qy: float, qz: float, qw: float) -> Matrix | None:
    """The rotation of a quaternion of any length from the body to the world; None for one that is none."""
    length = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(length) or length == 0.0:
        return None
    matrix: Matrix = rotation_of(*(each / length for each in (qx, qy, qz, qw)))
    return matrix


def plus(*vectors: Vector) -> Vector:
    """The sum."""
    a, b, c = map(sum, zip(*vectors, strict=True))
    return a, b, c


def times(factor: float, v: Vector) -> Vector:
    """The vector, so many times as long."""
    return factor * v[0], factor * v[1], factor * v[2]


@dataclass(frozen=True)
class BodyState:
    """Velocity (m/s) and angular velocity (rad/s) of a body along its axes, at a time in us."""

    time: int
    velocity: Vector = ZERO
    rates: Vector = ZERO


_UNKNOWN = BodyState(-1)


def acceleration_of(before: BodyState, after: BodyState, lever: Vector) -> Vector:
    """The mean acceleration along the body's axes (m/s2) of a point at ``lever`` (m), from one state to another.

    With v and ω at the middle of both: v' + ω x v + ω' x l + ω x (ω x l).
    """
    per_second = MICROSECONDS / (after.time - before.time)
    velocity, rates = (times(0.5, plus(a, b)) for a, b in zip(_parts(before), _parts(after), strict=True))
    slower, turning = (
        times(per_second, plus(b, times(-1, a))) for a, b in zip(_parts(before), _parts(after), strict=True)
    )
    return plus(slower, cross(rates, velocity), cross(turning, lever), cross(rates, cross(rates, lever)))


def _parts(state: BodyState) -> tuple[Vector, Vector]:
    return state.velocity, state.rates


class InertialModel:
    """A sensor at ``lever`` (m) on a body, turned by ``mount``; it knows the body from the states that it is fed."""

    def __init__(self, lever: Vector = ZERO, mount: Matrix = UPRIGHT, gravity: float = 9.81) -> None:
        self._lever, self._gravity = lever, gravity
        self._to_sensor = inverse(mount)
        self._newest = self._used = _UNKNOWN
        self._acceleration = ZERO

    def feed(self, state: BodyState) -> None:
        """Take the body's state; one that is not newer than the last is ignored."""
        if state.time > self._newest.time:
            self._newest = state

    @property
    def is_known(self) -> bool:
        """Whether there was a state."""
        return self._newest is not _UNKNOWN

    @property
    def rates(self) -> Vector:
        """The angular velocity in rad/s about the sensor's axes."""
        return turned(self._to_sensor, self._newest.rates)

    def force(self, body: Matrix) -> Vector:
        """The specific force in m/s2 along the sensor's axes, with the body's attitude.

        It is the mean since the state of the last reading. Before the second state the body's velocities are held.
        """
        newest, used = self._newest, self._used
        if used is _UNKNOWN:
            used = BodyState(newest.time - 1, newest.velocity, newest.rates)
        if newest.time > used.time:
            self._acceleration = acceleration_of(used, newest, self._lever)
        self._used = newest
        upwards = turned(inverse(body), (0.0, 0.0, self._gravity))
        return turned(self._to_sensor, plus(self._acceleration, upwards))

    def direction(self, body: Matrix, world: Vector) -> Vector:
        """A vector of the world along the sensor's axes."""
        return turned(self._to_sensor, turned(inverse(body), world))

    def place(self, body: Matrix, position: Vector) -> Vector:
        """Where the sensor is in the world, in m."""
        return plus(position, turned(body, self._lever))


def magnetic_field(strength: float, inclination: float, declination: float, north: float) -> Vector:
    """The earth's field in the world: so strong (T), so far below the horizon and east of north (rad).

    ``north`` is where north is, counter-clockwise from the world's x axis, in rad.
    """
    level, direction = strength * math.cos(inclination), north - declination
    return level * math.cos(direction), level * math.sin(direction), -strength * math.sin(inclination)


EQUATOR, FLATTENING = 6_378_137.0, 1 / 298.257223563
"""WGS84: the larger half axis in m, and the flattening"""


@dataclass(frozen=True)
class Origin:
    """Where the world's origin is on earth: degrees and m; ``north`` in rad from its x axis, counter-clockwise."""

    latitude: float
    longitude: float
    altitude: float
    north: float

    def geolocation(self, place: Vector, east: float = 0.0, north: float = 0.0) -> tuple[float, float, float]:
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
