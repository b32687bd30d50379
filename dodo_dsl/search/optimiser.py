"""Where to drive next: points at which the margin is expected to be small, or of which little is known.

What is expected is a Gaussian process, after C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine
Learning, 2006, chapters 2 and 5.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.search.space import Point, Space
from dodo_dsl.spec.vary import Values

_BOLDNESS = (0.5, 1.0, 2.0, 3.0)
"""How many standard deviations below its mean a margin is hoped for, by turns."""
_ANYWHERE, _EDGES, _NEARBY = 256, 256, 256
_NEAR, _LEADERS = (0.02, 0.06, 0.2), 6
_MOST = 160
"""Drives that the surrogate is fitted to: those with the least margins, and others evenly."""
ENOUGH = -0.02
"""Margin below which one failure is as good as another, in generations that look for further ones."""
_SCALES = (0.1, 0.2, 0.4, 0.8, 1.6, 6.4)
"""Distances over which the margin may change, in shares of a range; beyond the last one, a range hardly matters."""
_FIRST = 0.8
_NOISE = 1e-3
"""Variance of what the ranges do not explain, in that of the margins."""
_ROUNDS = 2

Array = NDArray[np.float64]


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
    surrogate = None if _is_flat(margins) else fitted(points, margins, lists)
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


@dataclass(frozen=True, eq=False)
class Surrogate:
    """What is expected of the margin: ``points`` are an array of points x ranges with shares in [0, 1].

    ``targets`` are their margins less ``mean``, in units of ``deviation``; ``lists`` marks ranges that are lists. The
    kernel is Matern's with 5/2, and has a scale for each range.
    """

    points: Array
    targets: Array
    lists: NDArray[np.bool_]
    scales: Array
    mean: float
    deviation: float

    def expect(self, points: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of the margin at points."""
        from scipy.linalg import solve_triangular

        factor, weights = self._solved
        shared = _matern(_squares(points, self.points, self.lists), self.scales)
        mean = self.mean + self.deviation * (shared @ weights)
        explained = (solve_triangular(factor, shared.T, lower=True) ** 2).sum(axis=0)
        return mean, self.deviation * np.sqrt(np.maximum(1.0 - explained, 1e-12))

    def believing(self, points: Array) -> "Surrogate":
        """As if drives at these points had the margins expected there, so that others are looked at next."""
        believed = (self.expect(points)[0] - self.mean) / self.deviation
        targets = np.concatenate([self.targets, believed])
        return replace(self, points=np.vstack([self.points, points]), targets=targets)

    @cached_property
    def _solved(self) -> tuple[Array, Array]:
        return _solved(_squares(self.points, self.points, self.lists), self.scales, self.targets)


def fitted(points: Array, margins: Array, lists: NDArray[np.bool_]) -> Surrogate:
    """With the most likely scales."""
    mean, deviation = float(margins.mean()), float(margins.std()) or 1.0
    targets = (margins - mean) / deviation
    scales = _likeliest(_squares(points, points, lists), targets)
    return Surrogate(points, targets, lists, scales, mean, deviation)


def _likeliest(squares: Array, targets: Array) -> Array:
    scales = np.full(len(squares), _FIRST)
    best = _likelihood(squares, scales, targets)
    for _ in range(_ROUNDS):
        for dimension in range(len(scales)):
            kept = scales[dimension]
            for scale in _SCALES:
                scales[dimension] = scale
                likelihood = _likelihood(squares, scales, targets)
                if likelihood > best + 1e-9:
                    best, kept = likelihood, scale
            scales[dimension] = kept
    return scales


def _likelihood(squares: Array, scales: Array, targets: Array) -> float:
    """The logarithm, but for a constant."""
    factor, weights = _solved(squares, scales, targets)
    return float(-0.5 * targets @ weights - np.log(np.diag(factor)).sum())


def _solved(squares: Array, scales: Array, targets: Array) -> tuple[Array, Array]:
    """The Cholesky factor of the covariance, and the weights of the points."""
    from scipy.linalg import cho_solve

    covariance = _matern(squares, scales) + _NOISE * np.eye(len(targets))
    factor: Array = np.linalg.cholesky(covariance).astype(np.float64)
    weights: Array = cho_solve((factor, True), targets)
    return factor, weights


def _squares(one: Array, other: Array, lists: NDArray[np.bool_]) -> Array:
    """Squared distances by range, an array of ranges x points x points; different values of a list are 1 apart."""
    differences = one.T[:, :, None] - other.T[:, None, :]
    squares: Array = np.where(lists[:, None, None], (differences != 0).astype(float), differences**2)
    return squares


def _matern(squares: Array, scales: Array) -> Array:
    distance = np.sqrt(5.0 * np.tensordot(scales**-2.0, squares, axes=1))
    kernel: Array = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    return kernel


def _is_flat(margins: Array) -> bool:
    """Whether margins say nothing of where to look."""
    return len(margins) == 0 or math.isclose(float(margins.min()), float(margins.max()))
