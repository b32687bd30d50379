"""The evaluator of an open loop: a signal of the application against its target."""

from array import array
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from services.base import Evaluator, JudgedTime, UnjudgeableError, Verdict
from services.base.judged import FAILED, MOST_SAMPLES, WARNED
from services.continuous_signal.late import LateSamples
from services.continuous_signal.measures import SignalLimits, judged_time, measure
from services.continuous_signal.reason import verdict
from services.continuous_signal.target import MICROSECONDS, Target, Times, Values, in_order

MOST_IN_MEMORY = 10_000_000


_DAY = 86_400 * MICROSECONDS


@dataclass
class Samples:
    """Times (microseconds) and values as they come, 16 bytes each."""

    _times: "array[int]" = field(default_factory=lambda: array("q"))
    _values: "array[float]" = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time: int, value: float) -> None:
        """One more sample."""
        self._times.append(time)
        self._values.append(value)

    def since(self, zero: int) -> tuple[Times, Values]:
        """Copies of all, the times counted from `zero`."""
        return np.array(self._times, np.int64) - zero, np.array(self._values, np.float64)


class SignalEvaluator(Evaluator):
    """Consumes a signal, and the target where that is ``None``.

    Samples count from the begin of the test, or else from the target's own start. They may come in any order, but not
    late, and are kept until the verdict, which comes at MOST_IN_MEMORY of them at the latest.
    """

    def __init__(
        self, signal: str, target: Target | None, limits: SignalLimits, max_time: float, from_begin: bool
    ) -> None:
        """``signal`` is its name in sentences, ``max_time`` in s; ``from_begin``: samples count from the begin."""
        super().__init__(max_time)
        self._signal, self._target, self._limits = signal, target, limits
        self._from_begin = from_begin or target is None
        self._samples, self._targets = Samples(), Samples()
        self._late = LateSamples(limits.delay, self._from_begin)
        self.plot = self.judged.series(signal, distance=limits.distance, band=limits.band)

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
        measures = measure(target, times, values, self._limits, judged)
        said = verdict(self._signal, target, measures, self._limits, span.within, self._late.facts(start))
        return replace(said, evidence=measures.evidence())

    def record(self) -> None:
        """All samples with the target, which a live one may tell afterwards; of very many those that are farthest."""
        target = self._target or in_order(*self._targets.since(self.zero))
        start = self.zero if self._from_begin else target.start
        times, values = self._samples.since(start)
        away, limits = np.abs(values - target.at(times)), self._limits
        marks = np.select([away > (np.inf if limits.distance is None else limits.distance),
                           away > (np.inf if limits.band is None else limits.band)], [FAILED, WARNED])  # fmt: skip
        marks[~np.isfinite(values)] = FAILED
        marks[(times < limits.start) | (times > (np.inf if limits.until is None else limits.until))] = 0
        if abs(start - self.zero) > _DAY:  # of another day: from the begin of the test on
            start = self.zero
        for chosen in farthest_of(np.argsort(times, kind="stable"), np.nan_to_num(away, nan=-1.0)):
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
            raise UnjudgeableError(f"there is no time to judge: {spans}, {window}{ended}")
        return first, min(end, observed)

    def _observed(self, target: Target, is_complete: bool) -> int:
        """Until when the target's time was observed, in us; with sample times of their own by the newest sample.

        No less than the time of the test, or else the application could stay where the target is easy.
        """
        now = self.now or self.zero
        if self._from_begin:
            return min(now - self.zero, round(self._max_time * MICROSECONDS))
        newest = self._late.newest
        if is_complete or newest is None:
            return int(target.times[-1])
        observed = newest.time - target.start + (now - newest.arrival)
        least = 0 if self._limits.delay is None else min(now - self.zero, round(self._max_time * MICROSECONDS))
        return max(observed, least - (self._limits.delay or 0))


def farthest_of(order: NDArray[np.int64], away: Values) -> list[int]:
    """Samples in an order, or where they are more than are recorded, of each few the one that is farthest away."""
    each = -(-len(order) // MOST_SAMPLES) or 1
    parts = [order[begin : begin + each] for begin in range(0, len(order), each)]
    return [int(part[np.argmax(away[part])]) for part in parts]
