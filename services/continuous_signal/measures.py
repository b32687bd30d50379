"""How a signal compares with its target: its distance, the time that samples cover, late samples, and its shape.

The distance is by equations 4.6 to 4.9 of the thesis, and the same over time. Late are samples whose times are not
believed: holes must not be filled afterwards, nor the future be answered. The shape is how late the signal follows its
target, and how long it stays the same.
"""

from array import array
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.recording_times import DAY
from services.base import Check, Flags, Share
from services.base.evaluator import EARLY, Hidden
from services.base.service import at_limit
from services.continuous_signal.target import Target, Times, Values


@dataclass(frozen=True)
class Coverage:
    """The judged time, which share of it samples hold, and its longest gap without one; all times in s.

    Without samples the gap is the whole time. In ``hidden`` s of the gap nothing was shown, which do not count.
    """

    begin: float
    end: float
    share: float
    gap_begin: float
    gap_end: float
    hidden: float = 0.0

    @property
    def gap(self) -> float:
        return self.gap_end - self.gap_begin - self.hidden


def holds(times: Times, end: int, longest: int) -> Values:
    """How long each sample holds, in us: until the next or the `end`, and at most `longest`; `times` ascend."""
    found: Values = np.minimum(np.diff(np.append(times, end)), longest).astype(np.float64)
    return found


def cover(times: Times, begin: int, end: int, longest: int, hidden: Hidden | None = None) -> Coverage:
    """What samples cover of the time from `begin` to `end`; `times` ascend and are inside it, all in us.

    Time that is ``hidden`` does not pass.
    """
    edges = np.concatenate([[begin], times, [end]])
    shown = edges
    if hidden:
        lengths = np.diff(hidden, prepend=hidden[0])
        lengths[::2] = 0
        shown = edges - np.rint(np.interp(edges, hidden, np.cumsum(lengths))).astype(np.int64)
    gaps = np.diff(shown)
    at = int(np.argmax(gaps))
    share = float(holds(shown[1:-1], shown[-1], longest).sum()) / (shown[-1] - shown[0])
    lost = edges[at + 1] - edges[at] - gaps[at]
    return Coverage(*(float(each) for each in (
        begin / MICROSECONDS, end / MICROSECONDS, share, edges[at] / MICROSECONDS, edges[at + 1] / MICROSECONDS,
        lost / MICROSECONDS,
    )))  # fmt: skip


LONGEST_LAG, LAG_STEP = MICROSECONDS, MICROSECONDS // 100
"""The lags that are tried, in microseconds."""
EXPLAINS = 0.75
"""A lag counts when the mean distance to the target that much earlier is at most this share of that without a lag."""
MOST_LAGS = 20_000
"""Samples of which a lag is looked for that has no limit."""
HALF = 0.5
FEWEST = 10
"""Samples of which anything can be said."""


def lag(target: Target, times: Times, values: Values) -> float:
    """The time in s by which the signal follows its target late; 0 if no lag explains its distance."""
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
    """How the signal is like its target, such as ``about -1 times its target``; empty if neither a factor nor an
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


_DIGITS = 12
_ROUNDING = 1e-12
"""By which a sample at the edge of a relative band may be outside of it."""


class SignalLimits:
    """The service's flags, times of them in us; values are ``exact`` to a share of themselves, and may be so far off.

    A band that is a share of the target's size is ``relative``, and no less than ``floor``.
    """

    def __init__(self, flags: Flags, exact: float = 0.0) -> None:
        """Raises ValueError for flags that do not fit together."""
        for name in ("min-share", "min-frame-share"):
            if flags[name] is not None and flags["band"] is None:
                raise ValueError(f"--{name} needs --band, the distance that counts as inside")
        band, self.floor = flags["band"], flags["band-floor"] or 0.0
        self.relative = isinstance(band, Share)
        if self.floor and not self.relative and flags["min-sign-share"] is None:
            raise ValueError(
                "--band-floor needs a --band that is a share of the target, such as 25%, or --min-sign-share"
            )
        if flags["until"] is not None and flags["until"] <= flags["from"]:
            raise ValueError(f"--until={flags['until']:g} is not after --from={flags['from']:g}")
        self.flags, self.exact = flags, exact
        self.start: int
        self.delay: int
        self.band: float | None = band.of_one if isinstance(band, Share) else band
        names = ("from", "hold", "start-up", "max-delay")
        self.start, self.hold, self.start_up, self.delay = (round(flags[name] * MICROSECONDS) for name in names)
        self.until = None if flags["until"] is None else round(flags["until"] * MICROSECONDS)

    def __getitem__(self, name: str) -> float | None:
        value: float | None = self.flags[name]
        return value

    def exact_to(self, *values: Values) -> float:
        """To what the distance between values is exact."""
        return self.exact * sum(float(np.abs(each[np.isfinite(each)]).max(initial=0.0)) for each in values)

    def band_at(self, expected: Values) -> Values:
        """The distance from each of these targets up to which a sample is inside the band; without a band any is."""
        if self.band is None or not self.relative:
            return np.full(len(expected), np.inf if self.band is None else self.band)
        widths: Values = np.maximum(self.band * np.abs(expected), self.floor) * (1 + _ROUNDING)
        return widths


@dataclass(frozen=True)
class WorstSample:
    """The sample farthest from its target: its time in seconds, its value and the target's."""

    time: float
    value: float
    target: float


@dataclass(frozen=True)
class SignalMeasures:
    """The distances d of `samples` samples; `received` counts all in the window, `outside` those without a target.

    `broken` holds the times (s) of those in the window that are not finite. `mean`, `std` and `distance` are over
    samples, `mean_over_time`, `std_over_time` and `share` over the time that these hold. `repeats` is the
    longest run of samples with the same value, `likeness` what the signal is of its target, where that is simple.
    `frame_share` and `sign_share` are over samples and the `unanswered` frames. Without a sample all else is None.
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
    mean_over_time: float | None = None
    std_over_time: float | None = None
    coverage: Coverage | None = None
    lag: float | None = None
    repeats: RepeatedValue | None = None
    likeness: str = ""
    frame_share: float | None = None
    sign_share: float | None = None
    unanswered: int = 0

    def checks(self, limits: SignalLimits) -> tuple[Check, ...]:
        held, gap = (self.coverage.share, self.coverage.gap) if self.coverage else (None, None)
        run = self.repeats.samples if self.repeats else None
        asked = (
            Check.least("share", self.share, limits["min-share"]),
            Check.least("frame-share", self.frame_share, limits["min-frame-share"]),
            Check.least("sign-share", self.sign_share, limits["min-sign-share"]),
            Check.most("lag", self.lag, limits["max-lag"], "s"),
            Check.most("repeats", run, limits["max-repeats"]),
        )
        return (
            Check.most("mean", self.mean, limits["max-mean"]),
            Check.most("std", self.std, limits["max-std"]),
            Check.most("distance", self.distance, limits["max-distance"]),
            Check.most("mean-over-time", self.mean_over_time, limits["max-mean"], parameters=("max-mean",)),
            Check.most("std-over-time", self.std_over_time, limits["max-std"], parameters=("max-std",)),
            *(check for check in asked if check.limit or (check.name == "share" and limits.band is not None)),
            Check.least("samples", self.samples, limits["min-samples"]),
            Check.most("gap", gap, limits["max-gap"], "s"),
            Check.least("coverage", held, limits["min-coverage"]),
            Check("outside", self.outside),
            Check.most("broken", len(self.broken), 0),
        )

    def evidence(self) -> dict[str, float | str | None]:
        """The worst sample, the longest gap, and the first sample that is not finite; times in s of the target."""
        worst, gap = self.worst, self.coverage
        return {
            **({"time": worst.time, "value": worst.value, "target": worst.target} if worst else {}),
            **({"gap-begin": gap.gap_begin, "gap-end": gap.gap_end} if gap else {}),
            **({"broken-time": self.broken[0]} if self.broken else {}),
        }


def measure(
    target: Target,
    times: Times,
    values: Values,
    limits: SignalLimits,
    judged: tuple[int, int] | None = None,
    frames: Times | None = None,
    hidden: Hidden | None = None,
    is_copied: bool = True,
) -> SignalMeasures:
    """The measures of samples in any order, their times in microseconds on the target's own scale.

    ``judged`` is the part of the target's time that they have to cover; by default all of it. ``frames`` are the times
    of the pictures that have to be answered, ascending; by default each sample answers one. Samples have their times if
    these ``is_copied``, else they are counted. Nothing has to be held while frames are ``hidden``.
    """
    inside = times >= limits.start
    if limits.until is not None:
        inside &= times <= limits.until
    order = np.argsort(times[inside], kind="stable")
    times, values = times[inside][order], values[inside][order]
    finite = np.isfinite(values)
    broken = tuple((times[~finite] / MICROSECONDS).tolist())
    expected = target.at(times)
    known = finite & ~np.isnan(expected)
    samples, outside = int(known.sum()), int((finite & ~known).sum())
    begin, end = judged or judged_time(target, limits)
    if samples and times[known][0] <= limits.start_up:
        begin = max(begin, int(times[known][0]))
    coverage = _coverage(times[known], begin, end, limits.hold, hidden)
    if not samples:
        return SignalMeasures(len(times), 0, outside, broken, coverage=coverage)
    times, values, expected = times[known], values[known], expected[known]
    asked = times[:0] if frames is None else frames[(frames >= begin) & (frames <= end)]
    missed = _unanswered(target, asked, times) if is_copied else _left(target, asked[asked < end - EARLY], samples)
    distances: Values = np.abs(values - expected)
    at = int(np.argmax(distances))
    weights = holds(times, max(end, int(times[-1])), limits.hold)
    weights = weights if weights.any() else np.ones(samples)
    exact = limits.exact_to(values, expected)
    inside = distances <= limits.band_at(expected) + exact
    mean = _average(distances, weights)
    std = round(float(np.sqrt(np.average((distances - mean) ** 2, weights=weights))), _DIGITS)
    return SignalMeasures(
        received=len(known),
        samples=samples,
        outside=outside,
        broken=broken,
        mean=at_limit(float(distances.mean()), limits["max-mean"], exact),
        std=at_limit(float(distances.std()), limits["max-std"], exact),
        distance=at_limit(float(distances[at]), limits["max-distance"], exact),
        share=None if limits.band is None else _average(inside, weights),
        worst=WorstSample(float(times[at]) / MICROSECONDS, float(values[at]), float(expected[at])),
        mean_over_time=at_limit(mean, limits["max-mean"], exact),
        std_over_time=at_limit(std, limits["max-std"], exact),
        coverage=coverage,
        lag=lag(target, times, values) if limits["max-lag"] is not None or samples <= MOST_LAGS else None,
        repeats=longest_run(times, values),
        likeness=likeness(target, times, values),
        frame_share=None if limits.band is None else _share(inside, len(missed)),
        sign_share=_sign_share(values, expected, missed, limits.floor + exact),
        unanswered=len(missed),
    )


def _unanswered(target: Target, frames: Times, times: Times) -> Values:
    """The targets of the frames that have no sample from their own time to that of the next."""
    edges = np.append(frames, np.iinfo(np.int64).max)
    expected = target.at(frames[np.diff(np.searchsorted(times, edges)) == 0])
    known: Values = expected[~np.isnan(expected)]
    return known


def _left(target: Target, frames: Times, samples: int) -> Values:
    """The targets of as many frames as are more than the samples, evenly among them."""
    more = np.linspace(0, len(frames) - 1, max(0, len(frames) - samples)).astype(np.int64)
    expected = target.at(frames[more])
    known: Values = expected[~np.isnan(expected)]
    return known


def _sign_share(values: Values, expected: Values, missed: Values, floor: float) -> float | None:
    """The share of frames with the sign of their target, where that is farther than ``floor`` from 0; else None."""
    signed = np.abs(expected) > floor
    right, wrong = (values * expected > 0)[signed], int((np.abs(missed) > floor).sum())
    return _share(right, wrong) if len(right) + wrong else None


def _share(right: NDArray[np.bool_], others: int) -> float:
    return round(float(right.sum()) / (len(right) + others), _DIGITS)


def judged_time(target: Target, limits: SignalLimits) -> tuple[int, int]:
    """The part of the target's time that is in the window, in microseconds; empty if it ends before it begins."""
    begin, end = int(target.times[0]), int(target.times[-1])
    return max(begin, limits.start), end if limits.until is None else min(end, limits.until)


def _average(values: NDArray[Any], weights: Values) -> float:
    """Rounded, so that a value that equals its limit keeps it."""
    return round(float(np.average(values, weights=weights)), _DIGITS)


def _coverage(times: Times, begin: int, end: int, hold: int, hidden: Hidden | None) -> Coverage | None:
    is_seen = begin < end if not hidden else hidden.shown(begin) < hidden.shown(end)
    return cover(times[(times >= begin) & (times <= end)], begin, end, hold, hidden) if is_seen else None


class Arrival(NamedTuple):
    """A sample's time and when it arrived, both in us."""

    time: int
    arrival: int


class LateFacts(NamedTuple):
    """How many samples were late, and the first of them: its time in s, and when it arrived where that says more.

    ``date`` is that of its time if that is another clock's.
    """

    samples: int = 0
    time: float = 0.0
    arrival: float | None = None
    date: str = ""


class LateSamples:
    """Samples are late whose time is more than ``delay`` us before their arrival.

    Those of more than EARLY us after it are not believed, either.

    Where sample times are not those of the test (``is_test_time``), they are late when one came before them
    that is so much newer.
    """

    def __init__(self, delay: int, is_test_time: bool) -> None:
        self._delay, self._is_test_time = delay, is_test_time
        self._count = 0
        self.delays: array[int] = array("q")
        """From the time of each sample to its arrival, in us of the test."""
        self._first: Arrival | None = None
        self.newest: Arrival | None = None

    def take(self, time: int, arrival: int | None) -> bool:
        """Whether a sample is late; nothing is before the time of the test is known (``arrival`` is None)."""
        if arrival is None:
            return False
        if self._is_late(time, arrival):
            self._count += 1
            self._first = self._first or Arrival(time, arrival)
            return True
        if self._is_test_time:
            self.delays.append(arrival - time)
        if self.newest is None or time >= self.newest.time:
            self.newest = Arrival(time, arrival)
        return False

    def facts(self, zero: int) -> LateFacts:
        if self._first is None:
            return LateFacts()
        time, arrival = ((each - zero) / MICROSECONDS for each in self._first)
        if not self._is_test_time:
            return LateFacts(self._count, time)
        is_near = abs(self._first.time - self._first.arrival) <= DAY
        date = "" if is_near else str(np.datetime64(self._first.time, "us").astype("datetime64[D]"))
        return LateFacts(self._count, time, arrival, date)

    def _is_late(self, time: int, arrival: int) -> bool:
        if self._is_test_time:
            return arrival - time > self._delay or time - arrival > min(EARLY, self._delay)
        return self.newest is not None and self.newest.time - time > self._delay
