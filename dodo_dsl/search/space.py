"""The space that a test's ranges span: its points as values of the spec."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.source import Mapping, Scalar, resolve
from dodo_dsl.spec import quantity, vary
from dodo_dsl.spec.vary import PLACEHOLDERS, Range, Values

_STEPS = 3
"""A range of numbers has at least 10 to this power steps, so that values stay short."""
_LAST = math.nextafter(1.0, 0.0)

Point = tuple[float, ...]
"""A share in [0, 1] of each range."""


@dataclass(frozen=True)
class Space:
    """The ranges in their order; ``whole`` are those whose values have to be whole numbers."""

    ranges: tuple[Range, ...]
    whole: frozenset[str] = frozenset()

    def values(self, point: Point) -> Values:
        return {one.name: self._value(one, share) for one, share in zip(self.ranges, point, strict=True)}

    def point(self, texts: dict[str, str]) -> Point:
        """Where values lie, by their texts: the middle of the shares that become whole numbers and values of lists."""
        return tuple(self._share(one, texts[one.name]) for one in self.ranges)

    def snapped(self, point: Point) -> tuple[tuple[str, ...], Point]:
        """The texts of the ``values`` at a point, and the ``point`` of these, in less time than by both."""
        written, shares = [], []
        for one, share in zip(self.ranges, point, strict=True):
            if one.is_list:
                text = _listed(one, share).text
                shares.append(self._share(one, text))
            else:
                number = self._number(one, share)
                text = text_of(one, number)
                shares.append(self._share_of(one, number))
            written.append(text)
        return tuple(written), tuple(shares)

    @cached_property
    def _numbers(self) -> dict[str, tuple[Decimal, Decimal, Decimal]]:
        """Both ends and the resolution of each range of numbers: they are needed for each of thousands of points."""
        found = {}
        for one in self.ranges:
            if not one.is_list:
                low, high = (one.number(end.text) for end in one.ends)
                found[one.name] = low, high, step_of(one)
        return found

    def _share(self, one: Range, text: str) -> float:
        if one.is_list:
            return ([end.text for end in one.ends].index(text) + 0.5) / len(one.ends)
        return self._share_of(one, one.number(text))

    def _share_of(self, one: Range, number: Decimal) -> float:
        low, high, _ = self._numbers[one.name]
        if one.name in self.whole:
            first, last = math.ceil(low), math.floor(high)
            return float((number - first) + Decimal("0.5")) / (last - first + 1)
        return float((number - low) / (high - low))

    def _value(self, one: Range, share: float) -> Scalar:
        return _listed(one, share) if one.is_list else scalar(one, self._number(one, share))

    def _number(self, one: Range, share: float) -> Decimal:
        low, high, step = self._numbers[one.name]
        if one.name in self.whole:
            first, last = math.ceil(low), math.floor(high)
            return Decimal(first + int(min(share, _LAST) * (last - first + 1)))
        number = ((low + (high - low) * Decimal(share)) / step).to_integral_value() * step
        return min(max(number, low), high)


def step_of(one: Range) -> Decimal:
    """The resolution of a range of numbers, a power of ten in its unit."""
    low, high = (one.number(end.text) for end in one.ends)
    return Decimal(1).scaleb((high - low).adjusted() - _STEPS)


def scalar(one: Range, number: Decimal) -> Scalar:
    """A number of a range as an author writes it."""
    text = text_of(one, number)
    return Scalar(one.nominal.span, resolve(text), text)


def text_of(one: Range, number: Decimal) -> str:
    return f"{quantity.decimal_text(number)} {one.unit}".strip()


def _listed(one: Range, share: float) -> Scalar:
    return one.ends[int(min(share, _LAST) * len(one.ends))]


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


def sweep(space: Space, number: int, seed: int) -> Iterator[Values]:
    """The first points of a scrambled Sobol sequence, which a longer sweep with the same seed continues."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(len(space.ranges), scramble=True, seed=seed)
    points = sequence.random_base2(max(number - 1, 0).bit_length())[:number]
    yield from (space.values(tuple(map(float, point))) for point in points)
