"""Faults of what the application decides: steering and pedal."""

import math
import random
import time
from collections import deque
from collections.abc import Callable

from tests.faulty.kiwi import Driving, Make, driving, numbered

SEED = 7
LIMIT = 0.290888  # rad, the largest request of the example
TENTH = 10
LATER, JUDGED = 30, 60
"""Frames after which what was good turns bad: early, and when many tests have judged enough."""


def steer(change: Callable[[float], float]) -> Make:
    """Each request changed by itself."""
    return driving(lambda angle, pedal: (change(angle), pedal))


def press(change: Callable[[float], float]) -> Make:
    """Each pedal position changed by itself."""
    return driving(lambda angle, pedal: (angle, change(pedal)))


def tenth(change: Callable[[float], float]) -> Make:
    """Every tenth request changed, the first of them at once."""
    number = numbered()
    return steer(lambda angle: angle if number() % TENTH else change(angle))


def after(frames: int, change: Driving) -> Make:
    """All frames after the first ones changed."""
    number = numbered()
    return driving(lambda angle, pedal: change(angle, pedal) if number() >= frames else (angle, pedal))


def delayed(frames: int) -> Make:
    """Each request sent some frames later; straight ahead until then."""
    late = deque([0.0] * frames)

    def change(angle: float) -> float:
        late.append(angle)
        return late.popleft()

    return steer(change)


def frozen(frames: int) -> Make:
    """The request of one frame sent for ever."""
    held: list[float] = []

    def change(angle: float) -> float:
        if len(held) <= frames:
            held.append(angle)
        return held[-1]

    return steer(change)


def noisy(deviation: float) -> Make:
    """Gaussian noise of a deviation in rad, the same in every run."""
    noise = random.Random(SEED)
    return steer(lambda angle: angle + noise.gauss(0.0, deviation))


def smoothed(seconds: float) -> Make:
    """A low-pass with a time constant in s, which takes the time between two frames from the wall clock."""
    state, last = 0.0, time.monotonic()

    def change(angle: float) -> float:
        nonlocal state, last
        now = time.monotonic()
        state += (1.0 - math.exp((last - now) / seconds)) * (angle - state)
        last = now
        return state

    return steer(change)


STEERING_FAULTS: dict[str, Make] = {
    "steering-reversed": steer(lambda angle: -angle),
    "steering-offset": steer(lambda angle: angle + 0.03),
    "steering-delayed-3": delayed(3),
    "steering-delayed-6": delayed(6),
    "steering-gain-low": steer(lambda angle: 0.5 * angle),
    "steering-gain-high": steer(lambda angle: 2 * angle),
    "steering-saturated": steer(lambda angle: max(-0.04, min(0.04, angle))),
    "steering-frozen": frozen(5),
    "steering-bang-bang": steer(lambda angle: math.copysign(LIMIT, angle)),
    "steering-noisy": noisy(0.05),
    "steering-spikes": tenth(lambda _: LIMIT),
    "steering-degrees": steer(math.degrees),
    "steering-whole-degrees": steer(lambda angle: math.radians(round(math.degrees(angle)))),
    "steering-nan": steer(lambda _: math.nan),
    "steering-nan-tenth": tenth(lambda _: math.nan),
    "steering-infinite": steer(lambda _: math.inf),
    "steering-infinite-tenth": tenth(lambda _: math.inf),
    "steering-swapped": driving(lambda angle, pedal: (pedal, angle)),
    "steering-wall-clock": smoothed(1.0),
    "steering-good-then-bad": after(JUDGED, lambda angle, pedal: (-angle, pedal)),
    "pedal-zero": press(lambda _: 0.0),
    "pedal-reverse": press(lambda pedal: -pedal),
    "pedal-maximum": press(lambda _: 0.14),
    "pedal-too-fast": press(lambda _: 0.13),
    "pedal-percent": press(lambda pedal: 100 * pedal),
    "pedal-stops": after(LATER, lambda _angle, _pedal: (0.0, 0.0)),
}
