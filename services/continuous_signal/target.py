"""The target of a signal: samples in the order of their times, and straight lines between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.inputs.target_table import MICROSECONDS, TargetError

__all__ = ["MICROSECONDS", "Target", "TargetError", "Times", "Values", "in_order"]

Times = NDArray[np.int64]
"""Microseconds."""

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """`values` at `times`, which increase strictly, in microseconds from `start`, itself in microseconds."""

    times: Times
    values: Values
    start: int = 0

    def at(self, times: Times) -> Values:
        """The target at any times by linear interpolation (thesis 4.3.2); NaN before its begin and after its end."""
        if not len(self.times):
            return np.full(len(times), np.nan)
        first = self.times[0]
        places, knots = (times - first).astype(np.float64), (self.times - first).astype(np.float64)
        values: Values = np.interp(places, knots, self.values, left=np.nan, right=np.nan)
        return values

    @property
    def span(self) -> tuple[float, float]:
        """Where it begins and ends, in seconds from `start`."""
        return float(self.times[0]) / MICROSECONDS, float(self.times[-1]) / MICROSECONDS


def in_order(times: Times, values: Values, start: int = 0) -> Target:
    """The target of samples in any order; of those with one and the same time the last counts."""
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    last = np.append(times[1:] != times[:-1], True)[: len(times)]
    return Target(times[last], values[last], start)
