"""Twelve mistakes of a steering program, each of which shows only in a corner of the ranges of ``planted.dodo.yml``.

A corner is within limits in some of the ranges, whatever the other conditions are; limits are shares of a range, 0 at
its ``from``. With ``onset`` the program already steers a little wrong in the corner's neighbourhood, as mistakes do
that grow; without it, nothing announces them.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

RANGES: dict[str, tuple[float, float]] = {
    "START": (-5, 5),
    "HEADING": (81, 87),
    "EXPOSURE": (0.5, 1.6),
    "MOUNTING": (-1, 1),
    "CONES": (0, 2),
    "LATENCY": (0, 100),
    "POWER": (0.9, 1.1),
}
"""Variables of the environment and the ranges in ``planted.dodo.yml``, in the same units."""

UNITS = " cmdegs"
"""Letters of these units."""

Driving = Callable[[float, float], tuple[float, float]]
"""Steering (rad) and pedal as they should be, and as they are sent."""

_NEIGHBOURHOOD = 0.3
_ONSET = 0.03  # rad


@dataclass(frozen=True)
class Bug:
    """Fails where the shares of the ranges named lie within their limits: there ``begin`` drives."""

    corner: Mapping[str, tuple[float, float]]
    begin: Callable[[], Driving]
    onset: bool = False

    @property
    def volume(self) -> float:
        """The share of the conditions in which it fails."""
        return math.prod(high - low for low, high in self.corner.values())

    def distance(self, shares: Mapping[str, float]) -> float:
        """From the corner, in shares of a range; 0 within it."""
        return max(max(low - shares[name], shares[name] - high, 0.0) for name, (low, high) in self.corner.items())

    def driving(self, shares: Mapping[str, float]) -> Driving:
        """What the program does under conditions."""
        away = self.distance(shares)
        if away == 0:
            return self.begin()
        wrong = _ONSET * max(1 - away / _NEIGHBOURHOOD, 0.0) if self.onset else 0.0
        return lambda angle, pedal: (angle + wrong, pedal)


def _reversed() -> Driving:
    return lambda angle, pedal: (-angle, pedal)


def _offset() -> Driving:
    return lambda angle, pedal: (angle + 0.12, pedal)


def _frozen() -> Driving:
    held: list[float] = []

    def drive(angle: float, pedal: float) -> tuple[float, float]:
        held.append(angle)
        return held[min(len(held), 3) - 1], pedal

    return drive


def _only_left() -> Driving:
    return lambda angle, pedal: (max(angle, 0.04), pedal)


def _crash() -> Driving:
    frames: Iterator[int] = iter(range(1_000_000))

    def drive(angle: float, pedal: float) -> tuple[float, float]:
        if next(frames) == 10:
            raise ZeroDivisionError("planted")
        return angle, pedal

    return drive


LOW, HIGH = "low", "high"


def _corner(**shares: tuple[str, float]) -> dict[str, tuple[float, float]]:
    return {name: (0.0, share) if end == LOW else (1.0 - share, 1.0) for name, (end, share) in shares.items()}


BUGS: dict[str, Bug] = {
    "dark-late": Bug(_corner(EXPOSURE=(LOW, 0.224), LATENCY=(HIGH, 0.224)), _reversed, onset=True),
    "fast-late": Bug(_corner(POWER=(HIGH, 0.141), LATENCY=(HIGH, 0.141)), _offset, onset=True),
    "right-dark": Bug(_corner(START=(HIGH, 0.141), EXPOSURE=(LOW, 0.141)), _frozen, onset=True),
    "left-outwards": Bug(_corner(START=(LOW, 0.1), HEADING=(HIGH, 0.1)), _only_left),
    "bright-tilted": Bug(_corner(EXPOSURE=(HIGH, 0.1), MOUNTING=(HIGH, 0.1)), _crash, onset=True),
    "weak-cones": Bug(_corner(POWER=(LOW, 0.1), CONES=(HIGH, 0.1)), _reversed),
    "dark-middle": Bug({"EXPOSURE": (0.0, 0.2), "START": (0.45, 0.5)}, _offset, onset=True),
    "middles": Bug({"HEADING": (0.3, 0.4), "POWER": (0.6, 0.7)}, _offset),
    "three-seen": Bug(
        _corner(EXPOSURE=(LOW, 0.2), LATENCY=(HIGH, 0.2), MOUNTING=(LOW, 0.2)), _reversed, onset=True
    ),
    "three-unseen": Bug(_corner(POWER=(HIGH, 0.17), CONES=(HIGH, 0.17), LATENCY=(HIGH, 0.17)), _offset),
    "three-start": Bug(
        _corner(START=(HIGH, 0.145), HEADING=(LOW, 0.145), POWER=(HIGH, 0.145)), _only_left, onset=True
    ),
    "four": Bug(
        _corner(START=(LOW, 0.234), EXPOSURE=(LOW, 0.234), LATENCY=(HIGH, 0.234), MOUNTING=(HIGH, 0.234)),
        _frozen, onset=True,
    ),
}  # fmt: skip
"""The good program is "none"."""
