"""Medians with their quartiles, and whether two of them differ by more than they spread."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FEWEST = 3
"""Rounds below which nothing is said about a difference."""


@dataclass(frozen=True)
class Spread:
    low: float
    middle: float
    high: float
    rounds: int

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Quartiles; raises ValueError when there are no values."""
        if not values:
            raise ValueError("no rounds")
        low, middle, high = np.percentile(values, (25, 50, 75)).tolist()
        return cls(low, middle, high, len(values))

    def order(self, other: "Spread") -> int:
        """1 when all of this lies above the other, -1 when below, 0 when they overlap or have too few rounds."""
        if min(self.rounds, other.rounds) < FEWEST:
            return 0
        return (self.low > other.high) - (self.high < other.low)
