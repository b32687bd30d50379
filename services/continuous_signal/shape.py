"""The shape of a signal over time: how late it follows its target, and how long it stays the same."""

from dataclasses import dataclass

import numpy as np

from services.continuous_signal.target import MICROSECONDS, Target, Times, Values

LONGEST_LAG, LAG_STEP = MICROSECONDS, MICROSECONDS // 100
"""The lags that are tried, in microseconds."""
EXPLAINS = 0.75
"""A lag counts when the mean distance to the target that much earlier is at most this share of that without a lag."""
HALF = 0.5
FEWEST = 10
"""Samples of which anything can be said."""


def lag(target: Target, times: Times, values: Values) -> float:
    """The time in s by which the signal follows its target late; 0 where no lag explains its distance."""
    plain = _mean_distance(target, times, values)
    lags = range(LAG_STEP, LONGEST_LAG + 1, LAG_STEP)
    best, late = min(((_mean_distance(target, times - late, values), late) for late in lags), default=(plain, 0))
    return late / MICROSECONDS if best <= EXPLAINS * plain and best < plain else 0.0


@dataclass(frozen=True)
class RepeatedValue:
    """Samples in a row with one and the same value, from a time in s on."""

    samples: int
    value: float
    time: float


def longest_run(times: Times, values: Values) -> RepeatedValue:
    """The first of the longest runs; samples in any order."""
    order = np.argsort(times, kind="stable")
    ordered = values[order]
    begins = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
    lengths = np.diff(np.append(begins, len(ordered)))
    longest = int(np.argmax(lengths))
    first = begins[longest]
    return RepeatedValue(int(lengths[longest]), float(ordered[first]), float(times[order][first]) / MICROSECONDS)


def likeness(target: Target, times: Times, values: Values) -> str:
    """How the signal is like its target, such as ``about -1 times its target``; empty where neither a factor nor an
    offset explains half of the distance. Samples are finite and inside the target.
    """
    expected = target.at(times)
    plain, squares = float(np.abs(values - expected).mean()), float((expected**2).sum())
    if len(values) < FEWEST or not plain or not squares:
        return ""
    factor, offset = float((values * expected).sum()) / squares, float((values - expected).mean())
    scaled, moved = (float(np.abs(values - fit).mean()) for fit in (factor * expected, expected + offset))
    if min(scaled, moved) > HALF * plain:
        return ""
    if scaled <= moved:
        return f"about {factor:.2g} times its target"
    return f"about {abs(offset):.2g} {'above' if offset > 0 else 'below'} its target"


def _mean_distance(target: Target, times: Times, values: Values) -> float:
    distances = np.abs(values - target.at(times))
    known = distances[~np.isnan(distances)]
    return float(known.mean()) if len(known) >= FEWEST else np.inf
