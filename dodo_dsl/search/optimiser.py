"""Where to drive next: points at which the margin is expected to be small, or of which little is known."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from dodo_dsl.search.space import Point, Space
from dodo_dsl.search.surrogate import Array, Surrogate, is_flat
from dodo_dsl.spec.instances.vary import Values

_BOLDNESS = (0.5, 1.0, 2.0, 3.0)
"""How many standard deviations below its mean a margin is hoped for, by turns."""
_ANYWHERE, _EDGES, _NEARBY = 256, 256, 256
_NEAR, _LEADERS = (0.02, 0.06, 0.2), 6
_MOST = 160
"""Drives that the surrogate is fitted to: those with the least margins, and others evenly."""
ENOUGH = -0.02
"""Margin below which one failure is as good as another, in generations that look for further ones."""


@dataclass(frozen=True)
class Tried:
    """A point that was driven, and its margin."""

    point: Point
    margin: float


def propose(
    space: Space,
    tried: Sequence[Tried],
    seen: Collection[tuple[str, ...]],
    number: int,
    seed: tuple[int, int],
    seeks_best: bool = False,
) -> list[Values]:
    """Up to ``number`` values that are not ``seen`` yet, always the same for the same arguments.

    ``seed`` is that of the search and the number of the generation. Odd generations look for failures that are far
    from those known, even ones for worse drives: margins below ENOUGH are alike in odd ones. With ``seeks_best``,
    the least margins matter alone: those of the other half are alike, as one crash would hide by how little good
    values differ.
    """
    if not tried:
        return []
    generator = np.random.default_rng(seed)
    used = _kept(tried)
    points = np.array([one.point for one in used])
    margins = np.array([one.margin for one in used])
    if seeks_best:
        margins = np.minimum(margins, np.median(margins))
    elif seed[1] % 2:
        margins = np.maximum(margins, ENOUGH)
    lists = np.array([one.is_list for one in space.ranges])
    surrogate = None if is_flat(margins) else Surrogate(points, margins, lists)
    taken = set(seen)
    found: list[Values] = []
    for turn in range(number):
        candidates = _candidates(space, points[np.argsort(margins, kind="stable")[:_LEADERS]], generator)
        snapped = (space.snapped(tuple(one)) for one in candidates.tolist())
        free = [(n, written, shares) for n, (written, shares) in enumerate(snapped) if written not in taken]
        if not free:
            break
        index = 0
        if surrogate is not None:
            driven = np.array([shares for _, _, shares in free])
            mean, deviation = surrogate.expect(driven)
            index = int(np.argmin(mean - _BOLDNESS[turn % len(_BOLDNESS)] * deviation))
            surrogate = surrogate.believing(driven[index : index + 1])
        best, written, _ = free[index]
        found.append(space.values(tuple(candidates[best].tolist())))
        taken.add(written)
    return found


def _kept(tried: Sequence[Tried]) -> list[Tried]:
    if len(tried) <= _MOST:
        return list(tried)
    order = sorted(range(len(tried)), key=lambda n: tried[n].margin)
    least, rest = order[: _MOST // 2], order[_MOST // 2 :]
    step = len(rest) / (_MOST // 2)
    return [tried[n] for n in sorted([*least, *(rest[int(step * n)] for n in range(_MOST // 2))])]


def _candidates(space: Space, leaders: Array, generator: np.random.Generator) -> Array:
    """Points anywhere, at ends of some of the ranges, and near the points with the least margins."""
    dimensions = len(space.ranges)
    anywhere = generator.random((_ANYWHERE, dimensions))
    edges = generator.random((_EDGES, dimensions))
    at_end = generator.random((_EDGES, dimensions)) < generator.random((_EDGES, 1))
    edges = np.where(at_end, np.round(edges), edges)
    near = leaders[generator.integers(len(leaders), size=_NEARBY)]
    widths = np.array(_NEAR)[generator.integers(len(_NEAR), size=(_NEARBY, 1))]
    moved = generator.random((_NEARBY, dimensions)) < 0.5
    near = np.where(moved, near + widths * generator.standard_normal((_NEARBY, dimensions)), near)
    return np.clip(np.vstack([anywhere, edges, near]), 0.0, 1.0)
