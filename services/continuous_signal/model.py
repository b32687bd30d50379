"""The evaluator of an open loop: a signal of the application against its target, with the verdict in one sentence."""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.recording_times import DAY
from services.base import Check, Evaluator, JudgedTime, UnjudgeableError, Verdict
from services.base.evaluator import EARLY, Hidden
from services.base.judged import FAILED, WARNED
from services.base.service import said
from services.continuous_signal.measures import (
    LateFacts,
    LateSamples,
    SignalLimits,
    SignalMeasures,
    judged_time,
    measure,
)
from services.continuous_signal.target import Target, Times, Values, in_order

_FAULTS = {
    "mean": "the mean distance is {value} ({bound})",
    "std": "the standard deviation is {value} ({bound})",
    "distance": "the largest distance is {value} ({bound})",
    "mean-over-time": "the mean distance over time is {value} ({bound})",
    "std-over-time": "the standard deviation over time is {value} ({bound})",
    "share": "the share of time within {width} of the target is {value} ({bound})",
    "frame-share": "the share of frames within {width} of the target is {value} ({bound}){unanswered}",
    "sign-share": "the share of frames with the sign of the target is {value} ({bound}){unanswered}",
    "lag": "it lags its target by {value} s ({bound} s)",
    "repeats": "{value} samples in a row have the same value, {run.value:z.4g}, from {run.time:.2f} s on ({bound})",
    "samples": "only {value} samples came ({bound}){outside}",
    "gap": "nothing came between {held.gap_begin:.2f} s and {held.gap_end:.2f} s ({bound} s)",
    "coverage": "the samples cover {value} of the time from {held.begin:.2f} s to {held.end:.2f} s ({bound})",
    "broken": "{value} samples are not finite numbers, the first at {first_broken:.2f} s",
}
_KEPT = ("mean", "std", "distance", "share", "frame-share", "sign-share")
_AT_ONCE = {"mean-over-time": "mean", "std-over-time": "std"}
"""Left out when the same over samples broke the limit, too."""


def verdict(
    signal: str, target: Target, measures: SignalMeasures, limits: SignalLimits, during: str, late: LateFacts
) -> Verdict:
    """Passed when every limit is kept; ``during`` is the observed time in words."""
    checks = (*measures.checks(limits), Check("late", late.samples))
    broken = {check.name: check for check in checks if not check.ok}
    told = [check for name, check in broken.items() if _AT_ONCE.get(name) not in broken]
    faults = [_fault(check, measures, limits) for check in told] if measures.samples else []
    faults = faults or ([] if measures.samples else [_nothing(signal, target, measures, during, late)])
    if faults:
        silent = not measures.received and not late.samples
        aside = _late(late) if measures.samples and late.samples else ""
        likeness = f"; the signal is {measures.likeness}" if measures.likeness and "repeats" not in broken else ""
        return Verdict("failed", "; ".join(faults) + likeness + _worst(measures) + aside, checks, silent=silent)
    kept = [f"{check.name} {check.told} ({check.bound})" for check in checks if _is_kept(check)]
    samples = f"{signal} kept to its target over {measures.samples} samples"
    aside = _late(late) if late.samples else ""
    return Verdict("passed", f"{samples}: {', '.join(kept)}{_worst(measures)}{aside}", checks)


def _is_kept(check: Check) -> bool:
    return bool(check.limit) and check.name in _KEPT


def _nothing(signal: str, target: Target, measures: SignalMeasures, during: str, late: LateFacts) -> str:
    if not measures.received:
        return f"no sample of {signal} came {during}" + (_late(late, ", but ") if late.samples else "")
    if measures.broken:
        return (
            f"{signal} was not a finite number in {_times(len(measures.broken))}, first at {measures.broken[0]:.2f} s"
        )
    begin, end = target.span
    return f"none of {measures.received} samples of {signal} is from the target's time, {begin:.2f} s to {end:.2f} s"


def _fault(check: Check, measures: SignalMeasures, limits: SignalLimits) -> str:
    if check.value is None:
        return f"{check.name} has no value ({check.bound})"
    return _FAULTS[check.name].format(
        value=check.told,
        bound=check.bound,
        width=_width(limits),
        run=measures.repeats,
        held=measures.coverage,
        first_broken=min(measures.broken, default=0.0),
        outside=f", and {measures.outside} outside the target's time" if measures.outside else "",
        unanswered=f", and {measures.unanswered} had no sample" if measures.unanswered else "",
    )


def _width(limits: SignalLimits) -> str:
    if limits.band is None or not limits.relative:
        return said(limits.band)
    return f"{limits.band * 100:.4g} %" + (f" or {said(limits.floor)}" if limits.floor else "")


def _late(late: LateFacts, begin: str = "; left out: ") -> str:
    count = f"{late.samples} sample{'' if late.samples == 1 else 's'}"
    if late.date:
        with_ = f"{count} with times of {late.date}, which are not the test's"
        return f"{begin}{with_}; if they are a recording's, write 'sample-times: test' at the service that plays it"
    where = "after newer ones" if late.arrival is None else f"which came at {late.arrival:.2f} s"
    return f"{begin}{count} whose time is not that of the arrival, the first of {late.time:.2f} s, {where}"


def _worst(measures: SignalMeasures) -> str:
    worst = measures.worst
    if worst is None:
        return ""
    return f"; worst at {worst.time:.2f} s: {said(worst.value)} with a target of {said(worst.target)}"


def _times(count: int) -> str:
    return "its one sample" if count == 1 else f"{count} samples"


MOST_IN_MEMORY = 10_000_000


@dataclass
class Samples:
    """Times (microseconds) and values as they come, 16 bytes each."""

    _times: "array[int]" = field(default_factory=lambda: array("q"))
    _values: "array[float]" = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time: int, value: float) -> None:
        self._times.append(time)
        self._values.append(value)

    def since(self, zero: int) -> tuple[Times, Values]:
        return np.array(self._times, np.int64) - zero, np.array(self._values, np.float64)


class SignalEvaluator(Evaluator):
    """Consumes a signal, and the target where that is ``None``.

    Samples count from the start of the test, or else from the target's own start. They may come in any order, but not
    late, and are kept until the verdict, which comes at MOST_IN_MEMORY of them at the latest.
    """

    def __init__(
        self,
        signal: str,
        target: Target | None,
        limits: SignalLimits,
        from_begin: bool,
        frames: Times | None = None,
        is_copied: bool = True,
    ) -> None:
        """``signal`` is its name in sentences; ``from_begin``: samples count from the start.

        ``frames`` are the times of the pictures that samples answer, on the target's own scale, which they have if
        these ``is_copied``.
        """
        super().__init__(limits.flags["max-time"])
        self._signal, self._target, self._limits = signal, target, limits
        self._frames, self._is_copied = frames, is_copied
        self._from_begin = from_begin or target is None
        self._samples, self._targets = Samples(), Samples()
        self._late = LateSamples(limits.delay, self._from_begin)
        self.plot = self.judged.series(
            signal, distance=limits["max-distance"], band=None if limits.relative else limits.band
        )

    def take(self, value: float, time: int) -> None:
        """A sample of the signal; a value that is not finite is a fault of the application."""
        if self.verdict is None and not self._late.take(time, self.arrival):
            self._samples.add(time, value)

    def take_target(self, value: float, time: int) -> None:
        """A sample of the target; raises UnjudgeableError for a value that is not finite."""
        if not np.isfinite(value):
            raise UnjudgeableError(f"a sample of the target is {value}, expected a finite number")
        if self.verdict is None:
            self._targets.add(time, value)

    def advance(self, now: int) -> None:
        is_full = max(len(self._samples), len(self._targets)) >= MOST_IN_MEMORY
        if is_full and not self.is_overdue(now):
            seconds = f"{self.elapsed(now):.2f} s, until memory was full"
            self.conclude(JudgedTime(f"in {seconds}", f"for {seconds}"))

    def decide(self, span: JudgedTime) -> Verdict:
        begin = self.zero
        target = self._target or in_order(*self._targets.since(begin))
        if not len(target.times):
            raise UnjudgeableError(f"no sample of the target came {span.within}")
        start = begin if self._from_begin else target.start
        times, values = self._samples.since(start)
        judged = self._judged(target, span.is_complete)
        hidden = Hidden(each - start for each in (self.hidden if self._from_begin else self.hidden_samples))
        frames = self._frames
        if frames is not None:
            frames = frames[[not hidden.hides(frame) for frame in frames.tolist()]]
        if hidden and hidden.shown(judged[0]) == hidden.shown(judged[1]):
            raise UnjudgeableError(f"no frame was shown {span.within}, so there was nothing to answer")
        about = self._limits, judged, frames, hidden, self._is_copied
        measures = measure(target, times, values, *about)
        if self._limits["min-sign-share"] is not None and measures.samples and measures.sign_share is None:
            raise UnjudgeableError(f"the target is nowhere farther than {self._limits.floor:g} from 0: it has no sign")
        said = verdict(self._signal, target, measures, self._limits, span.within, self._late.facts(start))
        self.notes = [*self._notes(target, measures)]
        blind = measure(target, times, np.zeros(len(values)), *about).checks(self._limits)
        if said.outcome == "passed" and all(check.ok for check in blind):
            self.notes.append("a signal that is always 0 keeps all limits, too")
        return replace(said, evidence=measures.evidence())

    def _notes(self, target: Target, measures: SignalMeasures) -> Iterator[str]:
        """What a verdict by other limits does not show: a signal that sees nothing, is late, or has no target."""
        if measures.outside > 0.1 * measures.received:
            begin, end = target.span
            many = f"{measures.outside} of {measures.received} samples of {self._signal} are not judged"
            yield f"{many}, as the target is from {begin:.2f} s to {end:.2f} s alone"
        run, lag, delays = measures.repeats, measures.lag, self._late.delays
        if run and 1 < run.samples == measures.samples:
            yield f"all {run.samples} samples of {self._signal} have the same value, {said(run.value)}"
        if lag and self._limits["max-lag"] is None:
            yield f"{self._signal} follows its target {lag:.2f} s late, and no max-lag is set"
        if delays and (delay := float(np.median(delays))) > EARLY:
            yield f"samples of {self._signal} came {delay / MICROSECONDS:.2f} s after their time (median)"

    def record(self) -> None:
        """All samples with the target, which a live one may send afterwards."""
        target = self._target or in_order(*self._targets.since(self.zero))
        start = self.zero if self._from_begin else target.start
        times, values = self._samples.since(start)
        expected, limits = target.at(times), self._limits
        away, exact = np.abs(values - expected), limits.exact_to(values, expected)
        marks = np.select([away > (np.inf if limits["max-distance"] is None else limits["max-distance"]) + exact,
                           away > limits.band_at(expected) + exact], [FAILED, WARNED])  # fmt: skip
        marks[~np.isfinite(values)] = FAILED
        marks[(times < limits.start) | (times > (np.inf if limits.until is None else limits.until))] = 0
        if abs(start - self.zero) > DAY:  # of another day: from the start of the test on
            start = self.zero
        for chosen in np.argsort(times, kind="stable"):
            self.plot.add(start + int(times[chosen]), float(values[chosen]), mark=int(marks[chosen]))
        for time, value in zip(target.times.tolist(), target.values.tolist(), strict=True):
            self.plot.aim(start + time, value)

    def _judged(self, target: Target, is_complete: bool) -> tuple[int, int]:
        """What samples have to cover of the target's time (us): of what was observed of it, all in the window.

        Raises UnjudgeableError when that is nothing.
        """
        first, end = judged_time(target, self._limits)
        observed = self._observed(target, is_complete)
        if first >= min(end, observed):
            spans = f"the target is from {target.span[0]:.2f} s to {target.span[1]:.2f} s"
            until = "" if self._limits.until is None else f" until {self._limits.until / MICROSECONDS:.2f} s"
            window = f"judged is from {self._limits.start / MICROSECONDS:.2f} s{until}"
            ended = f", and the test ended after {observed / MICROSECONDS:.2f} s" if observed < end else ""
            raise UnjudgeableError(f"no time to judge: {spans}, {window}{ended}")
        return first, min(end, observed)

    def _observed(self, target: Target, is_complete: bool) -> int:
        """Until when the target's time was observed, in us; with their own sample times by the newest sample.

        No less than the time of the test, or else the application could stay where the target is easy.
        """
        now = self.now or self.zero
        if self._from_begin:
            return min(now - self.zero, round(self._max_time * MICROSECONDS))
        newest = self._late.newest
        if is_complete or newest is None:
            return int(target.times[-1])
        observed: int = newest.time - target.start + (now - newest.arrival)
        return max(observed, min(now - self.zero, round(self._max_time * MICROSECONDS)) - self._limits.delay)
