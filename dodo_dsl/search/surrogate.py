"""What a search expects of the margin where it has not driven yet: a Gaussian process.

After C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, chapters 2 and 5.
"""

import math
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

_SCALES = (0.1, 0.2, 0.4, 0.8, 1.6, 6.4)
"""Distances over which the margin may change, in shares of a range; beyond the last one, a range hardly matters."""
_FIRST = 0.8
_NOISE = 1e-3
"""Variance of what the ranges do not explain, in that of the margins."""
_ROUNDS = 2

Array = NDArray[np.float64]


class Surrogate:
    """Fitted to margins at points, an array of points x ranges with shares in [0, 1]; ``lists`` marks lists.

    The kernel is Matern's with 5/2, and has a scale for each range, the most likely one.
    """

    def __init__(self, points: Array, margins: Array, lists: NDArray[np.bool_]) -> None:
        self._points, self._lists = points, lists
        self._mean, self._deviation = float(margins.mean()), float(margins.std()) or 1.0
        self._targets = (margins - self._mean) / self._deviation
        self._squares = _squares(points, points, lists)
        self.scales = np.full(points.shape[1], _FIRST)
        self._choose_scales()
        self._factor, self._weights = self._solved()

    def _choose_scales(self) -> None:
        best = self._likelihood()
        for _ in range(_ROUNDS):
            for dimension in range(len(self.scales)):
                kept = self.scales[dimension]
                for scale in _SCALES:
                    self.scales[dimension] = scale
                    likelihood = self._likelihood()
                    if likelihood > best + 1e-9:
                        best, kept = likelihood, scale
                self.scales[dimension] = kept

    def _solved(self) -> tuple[Array, Array]:
        from scipy.linalg import cho_solve

        covariance = _matern(self._squares, self.scales) + _NOISE * np.eye(len(self._points))
        factor: Array = np.linalg.cholesky(covariance).astype(np.float64)
        weights: Array = cho_solve((factor, True), self._targets)
        return factor, weights

    def _likelihood(self) -> float:
        """The logarithm, but for a constant."""
        factor, weights = self._solved()
        return float(-0.5 * self._targets @ weights - np.log(np.diag(factor)).sum())

    def expect(self, points: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of the margin at points."""
        from scipy.linalg import solve_triangular

        shared = _matern(_squares(points, self._points, self._lists), self.scales)
        mean = self._mean + self._deviation * (shared @ self._weights)
        explained = (solve_triangular(self._factor, shared.T, lower=True) ** 2).sum(axis=0)
        return mean, self._deviation * np.sqrt(np.maximum(1.0 - explained, 1e-12))

    def believing(self, points: Array) -> Self:
        """As if drives at these points had the margins expected there, so that others are looked at next."""
        grown: Any = object.__new__(type(self))
        mean = (self.expect(points)[0] - self._mean) / self._deviation
        grown._points, grown._lists = np.vstack([self._points, points]), self._lists
        grown._mean, grown._deviation, grown.scales = self._mean, self._deviation, self.scales
        grown._targets = np.concatenate([self._targets, mean])
        grown._squares = _squares(grown._points, grown._points, self._lists)
        grown._factor, grown._weights = grown._solved()
        return grown  # type: ignore[no-any-return]


def _squares(one: Array, other: Array, lists: NDArray[np.bool_]) -> Array:
    """Squared distances by range, an array of ranges x points x points; different values of a list are 1 apart."""
    differences = one.T[:, :, None] - other.T[:, None, :]
    squares: Array = np.where(lists[:, None, None], (differences != 0).astype(float), differences**2)
    return squares


def _matern(squares: Array, scales: Array) -> Array:
    distance = np.sqrt(5.0 * np.tensordot(scales**-2.0, squares, axes=1))
    kernel: Array = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    return kernel


def is_flat(margins: Array) -> bool:
    """Whether margins say nothing of where to look."""
    return len(margins) == 0 or math.isclose(float(margins.min()), float(margins.max()))
