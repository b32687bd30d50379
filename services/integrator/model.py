"""Position and orientation of a body from its velocities, exactly, whatever the step."""

from dataclasses import dataclass

from services.integrator.rotation import Quaternion, Vector, displacement, multiply, rotate, turn

MICROSECONDS = 1_000_000
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
    """The pose after `dt` seconds of a constant twist."""
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
        """Stand at the start until the next twist."""
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
