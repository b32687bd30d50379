"""The space that a test's ranges span: its points as values of the spec, and those that a search drives."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.source import Mapping, Scalar, resolve
from dodo_dsl.spec import quantity, vary
from dodo_dsl.spec.vary import PLACEHOLDERS, Range, Values

_STEPS = 3
"""A range of numbers has at least 10 to this power steps, so that values stay short."""
_LAST = math.nextafter(1.0, 0.0)
_CORNERS = 64
"""Drives of a search at the ends of all ranges, at most."""

Point = tuple[float, ...]
"""A share in [0, 1] of each range."""


@dataclass(frozen=True)
class Space:
    """The ranges in their order; ``whole`` are those whose values have to be whole numbers."""

    ranges: tuple[Range, ...]
    whole: frozenset[str] = frozenset()

    def values(self, point: Point) -> Values:
        return {one.name: self._value(one, share) for one, share in zip(self.ranges, point, strict=True)}

    def _value(self, one: Range, share: float) -> Scalar:
        if one.is_list:
            return one.ends[int(min(share, _LAST) * len(one.ends))]
        low, high = (one.number(end.text) for end in one.ends)
        if one.name in self.whole:
            first, last = math.ceil(low), math.floor(high)
            return scalar(one, Decimal(first + int(min(share, _LAST) * (last - first + 1))))
        step = step_of(one)
        number = ((low + (high - low) * Decimal(share)) / step).to_integral_value() * step
        return scalar(one, min(max(number, low), high))


def step_of(one: Range) -> Decimal:
    """The resolution of a range of numbers, a power of ten in its unit."""
    low, high = (one.number(end.text) for end in one.ends)
    return Decimal(1).scaleb((high - low).adjusted() - _STEPS)


def scalar(one: Range, number: Decimal) -> Scalar:
    """A number of a range as an author writes it."""
    text = f"{quantity.decimal_text(number)} {one.unit}".strip()
    return Scalar(one.nominal.span, resolve(text), text)


def texts(values: Values) -> dict[str, str]:
    return {name: value.text for name, value in values.items()}


def space_of(test: ResolvedTest) -> Space:
    """The space of an instance with ranges."""
    return Space(test.spec.ranges, frozenset(_whole(test)))


def _whole(test: ResolvedTest) -> set[str]:
    """The ranges that a parameter of whole numbers uses."""
    names: set[str] = set()
    for service in test.services:
        layer = test.spec.template.get(service.use.layer) if test.spec.template else None
        use = layer.get(service.use.name) if isinstance(layer, Mapping) else None
        written = use.get("with") if isinstance(use, Mapping) else None
        for name, entry in written.entries.items() if isinstance(written, Mapping) else ():
            parameter = service.manifest.parameters.get(name)
            if parameter and parameter.type == "integer":
                names |= PLACEHOLDERS.names(entry.value)
    return names


def nominal(space: Space) -> Values:
    return vary.nominal(space.ranges)


def sobol(dimensions: int, number: int, seed: int) -> Iterator[Point]:
    """The first points of a scrambled Sobol sequence, which a longer one with the same seed continues."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimensions, scramble=True, seed=seed)
    points = sequence.random_base2(max(number - 1, 0).bit_length())[:number]
    yield from (tuple(map(float, point)) for point in points)


def sweep(space: Space, number: int, seed: int) -> Iterator[Values]:
    """Values that fill the ranges evenly."""
    yield from map(space.values, sobol(len(space.ranges), number, seed))


@dataclass(frozen=True)
class Candidate:
    """Values to be driven; ``swept`` is whether they belong to the sweep, which shows how often the test fails."""

    values: Values
    swept: bool


def course(space: Space, number: int, seed: int) -> Iterator[Candidate]:
    """The first drives of a search: by turns one of the sweep, and one at an end of each range of numbers.

    They depend on nothing but the seed, so that any number of workers drives them in any order.
    """
    swept = sweep(space, number, seed)
    at_ends = itertools.islice(_corners(space, seed), _CORNERS)
    for turn in range(number):
        corner = next(at_ends, None) if turn % 2 else None
        yield Candidate(corner or next(swept), corner is None)


def _corners(space: Space, seed: int) -> Iterator[Values]:
    """Each once, in an order in which few of them have most pairs of ends."""
    lists = [one.is_list for one in space.ranges]
    seen: list[tuple[bool, ...]] = []
    for point in sobol(len(space.ranges), 8 * _CORNERS, (seed + 1) % (1 << 32)):
        ends = tuple(share >= 0.5 for share, is_list in zip(point, lists, strict=True) if not is_list)
        if ends not in seen:
            seen.append(ends)
            yield space.values(tuple(s if lis else round(s) for s, lis in zip(point, lists, strict=True)))
