"""Position and orientation of a body from its velocities, exactly, whatever the step.

Rotations are unit quaternions (x, y, z, w); the motion of a body of constant velocities is exact.
"""

import math
from dataclasses import dataclass

from dodo_dsl.opendlv.attitude import Quaternion, Vector, cross, heading_of
from dodo_dsl.opendlv.envelope import MICROSECONDS

SERIES = 0.05  # rad; below it the series is more exact than the quotient
UPRIGHT = 1 - 1e-12  # sine of a pitch at which roll and yaw cannot be distinguished


def angles(q: Quaternion) -> Vector:
    """Roll, pitch and yaw in rad of an attitude, as `quaternion` takes them; pitch is within +-pi/2.

    Where the body looks straight up or down, roll and yaw are one turn: all of it counts as yaw.
    """
    x, y, z, w = q
    sine = max(-1.0, min(1.0, 2 * (w * y - z * x)))
    if abs(sine) > UPRIGHT:
        return 0.0, math.copysign(math.pi / 2, sine), math.remainder(2 * math.atan2(z, w), math.tau)
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return roll, math.asin(sine), heading_of(*q) or 0.0


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation `b` done in the frame that `a` made; the product is scaled to length one."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    w = aw * bw - ax * bx - ay * by - az * bz
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length


def rotate(q: Quaternion, v: Vector) -> Vector:
    """The vector `v` of the body frame, in the frame that `q` turns it to."""
    axis = q[:3]
    t = cross(axis, v)
    return _sum(v, (2 * q[3], t), (2.0, cross(axis, t)))


def turn(rates: Vector, dt: float) -> Quaternion:
    """The rotation made in `dt` seconds by constant `rates` (rad/s) about the body's axes."""
    angle = dt * math.hypot(*rates)
    scale = dt / 2 * _sinc(angle / 2)
    return scale * rates[0], scale * rates[1], scale * rates[2], math.cos(angle / 2)


def displacement(velocity: Vector, rates: Vector, dt: float) -> Vector:
    """Where the body comes in `dt` seconds, in the body frame of the start (m).

    Exact for constant `velocity` (m/s) and `rates` (rad/s), both held in the moving body frame: the closed
    form of the exponential of a rigid motion, so that a circle stays a circle whatever the step.
    """
    phi = (dt * rates[0], dt * rates[1], dt * rates[2])
    angle = math.hypot(*phi)
    once = cross(phi, velocity)
    bent = _sum(velocity, (_half(angle), once), (_sixth(angle), cross(phi, once)))
    return dt * bent[0], dt * bent[1], dt * bent[2]


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if angle else 1.0


def _half(angle: float) -> float:
    """(1 - cos a) / a^2, which tends to 1/2."""
    return 0.5 * _sinc(angle / 2) ** 2


def _sixth(angle: float) -> float:
    """(a - sin a) / a^3, which tends to 1/6."""
    if angle < SERIES:
        return 1 / 6 - angle**2 / 120 + angle**4 / 5040
    return (angle - math.sin(angle)) / angle**3


def _sum(v: Vector, *terms: tuple[float, Vector]) -> Vector:
    x, y, z = v
    for scale, term in terms:
        x, y, z = x + scale * term[0], y + scale * term[1], z + scale * term[2]
    return x, y, z


AHEAD = 1_000_000  # us; a stamp further ahead than this is of another clock


@dataclass(frozen=True)
class BodyPose:
    """`position` in m in the world (z up) and `attitude`, the rotation from the body to the world."""

    position: Vector
    attitude: Quaternion


@dataclass(frozen=True)
class Twist:
    """`velocity` in m/s and angular `rates` in rad/s, about the body's x (forward), y (left), z (up)."""

    velocity: Vector = (0.0, 0.0, 0.0)
    rates: Vector = (0.0, 0.0, 0.0)


def move(pose: BodyPose, twist: Twist, dt: float) -> BodyPose:
    step = rotate(pose.attitude, displacement(twist.velocity, twist.rates, dt))
    x, y, z = pose.position
    return BodyPose((x + step[0], y + step[1], z + step[2]), multiply(pose.attitude, turn(twist.rates, dt)))


class Integrator:
    """A body through test time: each twist holds from its sample time until that of the next.

    Where twists and updates fall between each other therefore makes no difference, as long as a twist arrives
    before the first update past its time; one that comes later holds from the last update on. A sample time
    more than a second ahead of the update cannot be of the test's clock and counts as the last update's.
    """

    def __init__(self, start: BodyPose) -> None:
        self.pose = self._start = start
        self._twist = Twist()
        self._coming: list[tuple[int, Twist]] = []
        self._now: int | None = None

    def feed(self, twist: Twist, sample_time: int) -> None:
        """Take the body's twist at `sample_time` (microseconds)."""
        self._coming.append((sample_time, twist))

    def reset(self) -> None:
        self.pose, self._twist, self._coming = self._start, Twist(), []

    def update(self, now: int) -> BodyPose:
        """The pose at `now` (microseconds); the first call only takes the time.

        Raises ValueError when time runs backwards.
        """
        last = now if self._now is None else self._now
        if now < last:
            raise ValueError(f"time ran backwards by {last - now} us")
        dated = [(last if time > now + AHEAD else max(time, last), twist) for time, twist in self._coming]
        dated.sort(key=lambda item: item[0])
        self._coming = [item for item in dated if item[0] > now]
        for time, twist in dated:
            if time <= now:
                self._advance(time - last)
                last, self._twist = time, twist
        self._advance(now - last)
        self._now = now
        return self.pose

    def _advance(self, elapsed: int) -> None:
        self.pose = move(self.pose, self._twist, elapsed / MICROSECONDS)
