"""dodo stats: show how many services the tests share.

T tests need M = a T^b services together (thesis, section 5.1); the intervals are by Student's t distribution.
"""

import argparse
import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TextIO

import numpy as np

from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.compiler import load
from dodo_dsl.spec.model import Spec
from dodo_dsl.terminal import json_text, printable


def student_t_quantile(probability: float, freedom: int) -> float:
    """The value that t exceeds with 1 - ``probability``, for a probability from 0.5 to below 1, by bisection."""
    low, high = 0.0, 1.0
    while _cumulative(high, freedom) < probability:
        high *= 2
    while (middle := (low + high) / 2) not in (low, high):
        low, high = (middle, high) if _cumulative(middle, freedom) < probability else (low, middle)
    return low


def _cumulative(t: float, freedom: int) -> float:
    """The share below t >= 0: Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4."""
    angle = math.atan(t / math.sqrt(freedom))
    cosine, sine = math.cos(angle), math.sin(angle)
    is_odd = freedom % 2 == 1
    term = cosine if is_odd else 1.0
    total = 0.0
    for step in range(2 + is_odd, freedom + 1, 2):
        total += term
        term *= cosine**2 * (step - 1) / step
    inner = 2 / math.pi * (angle + sine * total) if is_odd else sine * total
    return (1 + inner) / 2


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
    wide = student_t_quantile((1 + LEVEL) / 2, freedom)
    of_b = wide * math.sqrt(variance / spread)
    of_a = wide * math.sqrt(variance * (1 / len(counts) + float(x.mean()) ** 2 / spread))
    return Power(ln_a, (ln_a - of_a, ln_a + of_a), b, (b - of_b, b + of_b))


EXAMPLES = """examples:
  dodo stats reuse          how many services each further test needs
  dodo stats reuse --json   the same as JSON

Services are those that tests name under 'uses', each counted once; instances of a matrix are one test. M = a T^b is
fitted by least squares to ln M over ln T, with 95 % intervals by Student's t. The curve depends on the order of tests,
so it is fitted as they are listed, and to its mean over all orders. Points of one growing set depend on each other: the
true intervals are wider.
"""

VERSION = 2
_ORDERS = (("in this order", in_order), ("mean of all orders", averaged))


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", choices=("reuse",), help="reuse: distinct services against the number of tests")
    parser.add_argument("--json", action="store_true", help="output as JSON")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    checked = load([])
    write_diagnostics(stderr, [found for found in checked.diagnostics if found.severity == "error"])
    tests = _services(checked.specs)
    if not tests:
        raise UsageError("the registry has no test that uses a service")
    stdout.write(as_json(tests) if options.json else as_text(tests))
    return Exit.OK


def _services(specs: Sequence[Spec]) -> dict[str, tuple[str, ...]]:
    """The services of each test by its name, those of all its instances, in the order of names."""
    named: dict[str, dict[str, None]] = {}
    for spec in specs:
        named.setdefault(spec.location.stem, {}).update(dict.fromkeys(use.uses.text for use in spec.uses))
    return {name: tuple(named[name]) for name in sorted(named) if named[name]}


def as_text(tests: Mapping[str, Sequence[str]]) -> str:
    """The growth test by test, and the fits."""
    counts = in_order(list(tests.values()))
    width = max(map(len, tests))
    lines = [f"{'test':<{width}}  services  together  new"]
    lines += [
        f"{name:<{width}}  {len(tests[name]):8}  {count:8g}  {', '.join(new)}".rstrip()
        for (name, new), count in zip(_new(tests), counts, strict=True)
    ]
    lines += ["", *_fits(f"{len(tests)} tests, {counts[-1]:g} services", list(tests.values()))]
    return "".join(f"{printable(line)}\n" for line in lines)


def as_json(tests: Mapping[str, Sequence[str]]) -> str:
    """The same as one object."""
    document = {"dodo": "reuse", "version": VERSION, "level": LEVEL, "registry": _document(tests)}
    return json_text(document)


def _document(tests: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    services = list(tests.values())
    fits = {}
    for key, (_, counted) in zip(("in_order", "averaged"), _ORDERS, strict=True):
        counts = counted(services)
        power = fit(counts)
        fits[key] = {"services": counts, "fit": vars(power) if power else None}
    return {"tests": {name: list(used) for name, used in tests.items()}, **fits}


def _fits(title: str, tests: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"{title}; M = a T^b"
    for name, counted in _ORDERS:
        power = fit(counted(tests))
        if power is None:
            yield f"  {name:<22}  at least {LEAST_TESTS} tests are needed"
            continue
        (low_a, high_a), (low, high) = power.ln_a_interval, power.b_interval
        said = f"b = {power.b:.2f} ({low:.2f} to {high:.2f}), ln a = {power.ln_a:.2f} ({low_a:.2f} to {high_a:.2f})"
        yield f"  {name:<22}  {said}"


def _new(tests: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, list[str]]]:
    """Each test with the services that none before it uses."""
    seen: set[str] = set()
    for name, services in tests.items():
        yield name, [service for service in services if service not in seen]
        seen.update(services)
