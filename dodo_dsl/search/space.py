"""The space that a test's ranges span: its points as values of the spec."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.source import Mapping, Scalar, resolve
from dodo_dsl.spec import quantity
from dodo_dsl.spec.instances import vary
from dodo_dsl.spec.instances.vary import PLACEHOLDERS, Range, Values

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

    def _share(self, one: Range, text: str) -> float:
        if one.is_list:
            return ([end.text for end in one.ends].index(text) + 0.5) / len(one.ends)
        low, high = (one.number(end.text) for end in one.ends)
        if one.name in self.whole:
            first, last = math.ceil(low), math.floor(high)
            return float((one.number(text) - first) + Decimal("0.5")) / (last - first + 1)
        return float((one.number(text) - low) / (high - low))

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


def sweep(space: Space, number: int, seed: int) -> Iterator[Values]:
    """The first points of a scrambled Sobol sequence, which a longer sweep with the same seed continues."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(len(space.ranges), scramble=True, seed=seed)
    points = sequence.random_base2(max(number - 1, 0).bit_length())[:number]
    yield from (space.values(tuple(map(float, point))) for point in points)
