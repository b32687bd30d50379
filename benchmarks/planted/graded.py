"""The example's steering with the mistake FAULT, ``KIND-GRADE``: the higher its grade, from 1 to 3, the worse."""

import os
import sys
from collections.abc import Callable, Iterator

import driver

Drive = Callable[..., tuple[float, float]]
good: Drive = driver.Driver.drive


def weak(grade: int) -> Drive:
    """It turns the wheel too little."""
    share = (0.4, 0.2, 0.1)[grade - 1]

    def drive(self: driver.Driver, *cones: list[driver.Point]) -> tuple[float, float]:
        angle, pedal = good(self, *cones)
        return share * angle, pedal

    return drive


def slow(grade: int) -> Drive:
    """It gives less pedal than it could."""
    share = (0.85, 0.7, 0.5)[grade - 1]

    def drive(self: driver.Driver, *cones: list[driver.Point]) -> tuple[float, float]:
        angle, pedal = good(self, *cones)
        return angle, share * pedal

    return drive


def aside(grade: int) -> Drive:
    """It drives beside the middle of its lane."""
    offset = (0.05, 0.08, 0.11)[grade - 1]  # m

    def drive(self: driver.Driver, *cones: list[driver.Point]) -> tuple[float, float]:
        return good(self, *([point._replace(left=point.left - offset) for point in side] for side in cones))

    return drive


def crash(grade: int) -> Drive:
    """It ends with an exception, the sooner the higher its grade."""
    last = (40, 20, 5)[grade - 1]
    frames: Iterator[int] = iter(range(1_000_000))

    def drive(self: driver.Driver, *cones: list[driver.Point]) -> tuple[float, float]:
        if next(frames) == last:
            raise ZeroDivisionError("planted")
        return good(self, *cones)

    return drive


KINDS = {"weak": weak, "slow": slow, "aside": aside, "crash": crash}


def main() -> int:
    kind, _, grade = os.environ["FAULT"].partition("-")
    if make := KINDS.get(kind):
        driver.Driver.drive = make(int(grade))  # type: ignore[method-assign]
    return driver.main()


if __name__ == "__main__":
    sys.exit(main())
