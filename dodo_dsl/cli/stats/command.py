"""dodo stats: show how many services the tests share."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TextIO

from dodo_dsl.cli.display.colours import write_diagnostics
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.stats import reuse
from dodo_dsl.compiler import load
from dodo_dsl.spec.model import Spec
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo stats reuse          how many services each further test needs
  dodo stats reuse --json   the same as JSON

Services are those that tests name under 'uses', each counted once; instances of a matrix are one test. M = a T^b is
fitted by least squares to ln M over ln T, with 95 % intervals by Student's t. The order of tests decides the curve, so
it is fitted as they are listed, and to its mean over all orders. Points of one growing set depend on each other: the
true intervals are wider.
"""

VERSION = 2
_ORDERS = (("in this order", reuse.in_order), ("mean of all orders", reuse.averaged))


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
    counts = reuse.in_order(list(tests.values()))
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
    document = {"dodo": "reuse", "version": VERSION, "level": reuse.LEVEL, "registry": _document(tests)}
    return json_text(document)


def _document(tests: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    services = list(tests.values())
    fits = {}
    for key, (_, counted) in zip(("in_order", "averaged"), _ORDERS, strict=True):
        counts = counted(services)
        power = reuse.fit(counts)
        fits[key] = {"services": counts, "fit": vars(power) if power else None}
    return {"tests": {name: list(used) for name, used in tests.items()}, **fits}


def _fits(title: str, tests: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"{title}; M = a T^b"
    for name, counted in _ORDERS:
        power = reuse.fit(counted(tests))
        if power is None:
            yield f"  {name:<22}  at least {reuse.LEAST_TESTS} tests are needed"
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
