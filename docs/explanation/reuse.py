#!/usr/bin/env python3
"""How many services the tests of a registry share: M = a T^b for M services and T tests (the thesis, section 5.1).

Run it where `dodo.yml` is: `python docs/explanation/reuse.py`. It fits ln M over ln T by least squares, with 95 %
intervals by Student's t: in the order of the tests' names, and to the mean of M over all orders.
"""

import math
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
from scipy import stats

from dodo_dsl.compiler import load


def in_order(tests: Sequence[Collection[str]]) -> list[float]:
    """The number of distinct services of the first test, of the first two, and so on."""
    return [float(len(set().union(*tests[: number + 1]))) for number in range(len(tests))]


def averaged(tests: Sequence[Collection[str]]) -> list[float]:
    """The same as the mean over all orders.

    Of N tests, a service that n use is missing among T with the probability C(N - n, T) / C(N, T).
    """
    total = len(tests)
    users = Counter(service for services in tests for service in set(services)).values()
    sizes = range(1, total + 1)
    return [sum(1 - math.comb(total - n, size) / math.comb(total, size) for n in users) for size in sizes]


def fit(counts: Sequence[float]) -> str:
    """The line through three counts or more in log space."""
    line = stats.linregress(np.log(np.arange(1, len(counts) + 1)), np.log(counts))
    wide = stats.t.ppf(0.975, len(counts) - 2)
    b, ln_a = wide * line.stderr, wide * line.intercept_stderr
    return (
        f"b = {line.slope:.2f} ({line.slope - b:.2f} to {line.slope + b:.2f}), "
        f"ln a = {line.intercept:.2f} ({line.intercept - ln_a:.2f} to {line.intercept + ln_a:.2f})"
    )


def main() -> None:
    named: dict[str, set[str]] = {}
    for spec in load([]).specs:
        named.setdefault(spec.location.stem, set()).update(use.uses.text for use in spec.uses)
    tests = {name: services for name, services in sorted(named.items()) if services}
    for (name, services), together in zip(tests.items(), in_order(list(tests.values())), strict=True):
        print(f"{name:<30} {len(services):3} services, {together:3g} together")
    print(f"in this order       {fit(in_order(list(tests.values())))}")
    print(f"mean of all orders  {fit(averaged(list(tests.values())))}")


if __name__ == "__main__":
    main()
