"""Shrinks a failure: as few values as possible away from nominal, and these as near to it as possible.

After A. Zeller and R. Hildebrandt, Simplifying and Isolating Failure-Inducing Input, 2002, with a search for
the limit of each value that is left.
"""

from collections.abc import Generator, Sequence
from decimal import Decimal

from dodo_dsl.search.space import Space, nominal, scalar, step_of, texts
from dodo_dsl.search.store import Drive
from dodo_dsl.spec.instances.vary import Range, Values

_PARTS = 4
_ROUNDS = 6
"""Rounds in each of which a way becomes a quarter: less than a thousandth is left."""

Shrinking = Generator[list[Values], Sequence[bool], Values]
"""Asks which of some values still fail for the same reason, and returns the last ones."""


def nearest(space: Space, failed: Sequence[Drive]) -> Drive:
    """The drive that is nearest to the nominal values, by shares of the ranges."""
    middle = space.point(texts(nominal(space)))

    def way(drive: Drive) -> tuple[float, int]:
        point = space.point(dict(drive.values))
        return sum(abs(one - other) for one, other in zip(point, middle, strict=True)), drive.number

    return min(failed, key=way)


def changed(space: Space, values: Values) -> list[str]:
    """The ranges whose values are not nominal."""
    return [one.name for one in space.ranges if values[one.name].text != one.nominal.text]


def most_drives(space: Space, values: Values) -> int:
    """How many drives ``shrink`` takes at most; most often, values go back to nominal, and it takes far fewer."""
    away = changed(space, values)
    numbers = sum(one.name in away and not one.is_list for one in space.ranges)
    return len(away) * (len(away) + 1) + numbers * _ROUNDS * (_PARTS - 1)


def shrink(space: Space, values: Values) -> Shrinking:
    """Values that fail, from others that do."""
    values = yield from _fewer(space, values)
    for one in space.ranges:
        if not one.is_list and one.name in changed(space, values):
            values = yield from _nearer(space, values, one)
    return values


def _fewer(space: Space, values: Values) -> Shrinking:
    """Puts values back to nominal, one after the other, until none of them can be."""
    plain = nominal(space)
    while names := changed(space, values):
        single = [values | {name: plain[name]} for name in names]
        fails = yield single
        free = [name for name, still in zip(names, fails, strict=True) if still]
        if not free:
            return values
        more = [values | {name: plain[name] for name in free[: n + 1]} for n in range(len(free))]
        fails = yield more
        values = next((one for one, still in zip(reversed(more), reversed(fails), strict=True) if still), more[0])
    return values


def _nearer(space: Space, values: Values, one: Range) -> Shrinking:
    """Moves a number towards its nominal value, as far as it still fails."""
    passes, fails_at = one.number(one.nominal.text), one.number(values[one.name].text)
    step = Decimal(1) if one.name in space.whole else step_of(one)
    for _ in range(_ROUNDS):
        parts = [passes + (fails_at - passes) * n / _PARTS for n in range(1, _PARTS)]
        rounded = dict.fromkeys((part / step).to_integral_value() * step for part in parts)
        between = [number for number in rounded if min(passes, fails_at) < number < max(passes, fails_at)]
        if not between:
            break
        tried = [values | {one.name: scalar(one, number)} for number in between]
        fails = yield tried
        first = next((n for n, still in enumerate(fails) if still), None)
        if first is None:
            passes = between[-1]
            continue
        values, fails_at = tried[first], between[first]
        passes = between[first - 1] if first else passes
    return values
