"""How many drives dodo search needs until it finds a planted bug, beside uniform random drives.

    python benchmarks/planted/functions.py [--seeds 5] [--most 400]

A drive is stood in for by a function: an application that fails in a corner of two to four of its ranges, whatever the
others are, and whose margin elsewhere falls off in some of the ranges, or in none of those of the bug. No program runs,
so this compares ways to search and shows nothing about the time of a drive.
"""

import argparse
import random
import statistics
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # this checkout

from dodo_dsl.diagnostics import Span
from dodo_dsl.search.space import Space, course, texts
from dodo_dsl.source import Scalar
from dodo_dsl.spec.vary import Range

_SPARE, _LEAST, FAILED = 0.5, 0.02, -0.4


@dataclass(frozen=True)
class Bug:
    """Fails where all of ``trigger`` lie within their limits; ``slopes`` are what the margin loses from nominal."""

    name: str
    ranges: int
    trigger: Mapping[int, tuple[float, float]]
    slopes: Mapping[int, float]

    @property
    def volume(self) -> float:
        """The share of the space in which it fails."""
        share = 1.0
        for low, high in self.trigger.values():
            share *= high - low
        return share

    def margin(self, point: list[float]) -> float:
        if all(low <= point[one] <= high for one, (low, high) in self.trigger.items()):
            return FAILED
        return max(_SPARE - sum(slope * abs(point[one] - 0.5) for one, slope in self.slopes.items()), _LEAST)


BUGS = (
    Bug("two ends, seen by both", 4, {0: (0.776, 1), 2: (0, 0.224)}, {0: 0.3, 2: 0.3}),
    Bug("two ends, seen by both", 4, {0: (0.9, 1), 2: (0, 0.1)}, {0: 0.3, 2: 0.3}),
    Bug("two ends, seen by one", 4, {0: (0.9, 1), 2: (0, 0.1)}, {0: 0.3}),
    Bug("two ends, seen by another", 4, {0: (0.9, 1), 2: (0, 0.1)}, {1: 0.3}),
    Bug("end and middle, seen by one", 3, {0: (0.8, 1), 2: (0.45, 0.5)}, {0: 0.3}),
    Bug("end and middle, seen by both", 3, {0: (0.8, 1), 2: (0.45, 0.5)}, {0: 0.3, 2: 0.2}),
    Bug("two middles, seen by none", 3, {0: (0.3, 0.4), 2: (0.6, 0.7)}, {1: 0.3}),
    Bug("two ends, seen by none", 5, {1: (0.9, 1), 3: (0.9, 1)}, {0: 0.3, 2: 0.3}),
    Bug("three ends, seen by all", 6, {0: (0.8, 1), 2: (0, 0.2), 4: (0.8, 1)}, {0: 0.3, 1: 0.2, 2: 0.3, 4: 0.1}),
    Bug("three ends, seen by two", 6, {0: (0.855, 1), 2: (0, 0.145), 4: (0.855, 1)}, {0: 0.3, 1: 0.2, 2: 0.3}),
    Bug("three ends, seen by none", 6, {0: (0.855, 1), 2: (0, 0.145), 4: (0.855, 1)}, {1: 0.3}),
    Bug("four ends, seen by two", 6, {0: (0.766, 1), 2: (0, 0.234), 4: (0.766, 1), 5: (0.766, 1)}, {0: 0.3, 2: 0.3}),
)


def space_of(bug: Bug) -> Space:
    nowhere = Span("planted/functions.py")
    ends = tuple(Scalar(nowhere, number, str(number)) for number in (0, 1))
    middle = Scalar(nowhere, 0.5, "0.5")
    return Space(tuple(Range(f"r{number}", middle, ends) for number in range(bug.ranges)))


def searched(bug: Bug, seed: int) -> Iterator[float]:
    """The margins of the drives of a search."""
    for one in course(space_of(bug), 1 << 10, seed):
        yield bug.margin([float(text) for text in texts(one.values).values()])


def at_random(bug: Bug, seed: int) -> Iterator[float]:
    generator = random.Random(seed)
    while True:
        yield bug.margin([generator.random() for _ in range(bug.ranges)])


def until_failure(margins: Iterator[float], most: int) -> int:
    """The number of drives up to the first failure; one more than ``most`` if none of these fails."""
    return next((number for number, margin in enumerate(margins, 1) if margin < 0 or number > most), most + 1)


WAYS: dict[str, Callable[[Bug, int], Iterator[float]]] = {"search": searched, "random": at_random}


def options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Drives until the first failure, median (least to most) of the seeds.")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--most", type=int, default=400)
    return parser


def print_table(bugs: Iterable[Bug], flags: argparse.Namespace) -> None:
    """A line a bug, as soon as it is known."""
    names = "".join(f"{name:<18}" for name in WAYS)
    print(f"{'bug':<30} volume  {names}random, by the volume", flush=True)
    for bug in bugs:
        cells = []
        for way in WAYS.values():
            found = [until_failure(way(bug, seed), flags.most) for seed in range(flags.seeds)]
            cells.append(f"{f'{statistics.median(found):g} ({min(found)} to {max(found)})':<18}")
        print(f"{bug.name:<30} {bug.volume:6.2%}  {''.join(cells)}{0.693 / bug.volume:.0f}", flush=True)


def main() -> None:
    print_table(BUGS, options().parse_args())


if __name__ == "__main__":
    main()
