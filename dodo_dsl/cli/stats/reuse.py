"""How many services tests need, T tests together: the curve M = a T^b of the thesis (section 5.1)."""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.cli.stats.student_t import quantile

LEVEL = 0.95
"""Of the intervals."""
LEAST_TESTS = 3
"""That a line with an interval needs."""


@dataclass(frozen=True)
class Power:
    """ln M = ``ln_a`` + ``b`` ln T by least squares, each with the ends of its interval."""

    ln_a: float
    ln_a_interval: tuple[float, float]
    b: float
    b_interval: tuple[float, float]


def in_order(tests: Sequence[Collection[str]]) -> list[float]:
    """The number of distinct services of the first test, of the first two, and so on."""
    seen: set[str] = set()
    counts = []
    for services in tests:
        seen.update(services)
        counts.append(float(len(seen)))
    return counts


def averaged(tests: Sequence[Collection[str]]) -> list[float]:
    """The same as the mean over all orders of the tests.

    Of N tests, a service that n use is missing among T with the probability C(N - n, T) / C(N, T).
    """
    total = len(tests)
    users = Counter(service for services in tests for service in set(services))
    return [
        sum(1 - math.comb(total - n, size) / math.comb(total, size) for n in users.values())
        for size in range(1, total + 1)
    ]


def fit(counts: Sequence[float]) -> Power | None:
    """The line through the counts in log space; None for fewer than three tests."""
    if len(counts) < LEAST_TESTS:
        return None
    x, y = np.log(np.arange(1, len(counts) + 1)), np.log(counts)
    spread = float(((x - x.mean()) ** 2).sum())
    b = float(((x - x.mean()) * y).sum()) / spread
    ln_a = float(y.mean() - b * x.mean())
    freedom = len(counts) - 2
    variance = float(((y - ln_a - b * x) ** 2).sum()) / freedom
    wide = quantile((1 + LEVEL) / 2, freedom)
    of_b = wide * math.sqrt(variance / spread)
    of_a = wide * math.sqrt(variance * (1 / len(counts) + float(x.mean()) ** 2 / spread))
    return Power(ln_a, (ln_a - of_a, ln_a + of_a), b, (b - of_b, b + of_b))
