"""How far a signal is from its target: equations 4.6 to 4.9 of the thesis, and the checks made of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from services.base import Check
from services.continuous_signal.target import MICROSECONDS, Target, Times, Values


@dataclass(frozen=True)
class SignalLimits:
    """Limits of a signal, in its own unit; None for no limit.

    `start` and `until` are the window of time that is judged, in microseconds, both included; at least `samples`
    have to be judged.
    """

    mean: float | None = None
    std: float | None = None
    distance: float | None = None
    band: float | None = None
    share: float | None = None
    samples: int = 1
    start: int = 0
    until: int | None = None


@dataclass(frozen=True)
class WorstSample:
    """The sample farthest from its target: its time in seconds, its value and the target's."""

    time: float
    value: float
    target: float


@dataclass(frozen=True)
class SignalMeasures:
    """The distances d of `samples` samples; `received` counts all in the window, `outside` those without a target.

    `broken` holds the times (s) of those in the window that are not finite. Without a sample all else is None.
    """

    received: int
    samples: int
    outside: int
    broken: tuple[float, ...]
    mean: float | None = None
    std: float | None = None
    distance: float | None = None
    share: float | None = None
    worst: WorstSample | None = None

    def checks(self, limits: SignalLimits) -> tuple[Check, ...]:
        """Each measure with its limit; one that has no value does not keep a limit."""
        share = () if limits.band is None else (_check("share", self.share, "min", limits.share),)
        return (
            _check("mean", self.mean, "max", limits.mean),
            _check("std", self.std, "max", limits.std),
            _check("distance", self.distance, "max", limits.distance),
            *share,
            _check("samples", self.samples, "min", limits.samples),
            Check("outside", self.outside),
            _check("broken", len(self.broken), "max", 0),
        )


def measure(target: Target, times: Times, values: Values, limits: SignalLimits) -> SignalMeasures:
    """The measures of samples in any order, their times in microseconds on the target's own scale."""
    inside = times >= limits.start
    if limits.until is not None:
        inside &= times <= limits.until
    times, values = times[inside], values[inside]
    finite = np.isfinite(values)
    broken = tuple((np.sort(times[~finite]) / MICROSECONDS).tolist())
    expected = target.at(times)
    known = finite & ~np.isnan(expected)
    samples, outside = int(known.sum()), int((finite & ~known).sum())
    if not samples:
        return SignalMeasures(len(times), 0, outside, broken)
    times, values, expected = times[known], values[known], expected[known]
    distances: Values = np.abs(values - expected)
    at = int(np.argmax(distances))
    return SignalMeasures(
        received=len(known),
        samples=samples,
        outside=outside,
        broken=broken,
        mean=float(distances.mean()),
        std=float(distances.std()),
        distance=float(distances[at]),
        share=None if limits.band is None else float((distances <= limits.band).mean()),
        worst=WorstSample(float(times[at]) / MICROSECONDS, float(values[at]), float(expected[at])),
    )


def _check(name: str, value: float | None, side: str, limit: float | None) -> Check:
    if limit is None:
        return Check(name, value)
    ok = value is not None and (value <= limit if side == "max" else value >= limit)
    bounds: Mapping[str, float] = {side: limit}
    return Check(name, value, bounds, "", ok)
