"""The judge of an open loop: a signal of the application against its target."""

from array import array
from dataclasses import dataclass, field

import numpy as np

from services.base import Verdict
from services.continuous_signal.measures import Limits, measure
from services.continuous_signal.reason import verdict
from services.continuous_signal.target import MICROSECONDS, Target, Times, Values, in_order

MOST_SAMPLES = 10_000_000


class UnjudgeableError(Exception):
    """There is nothing to judge the application by: the test itself is at fault."""


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


class Judge:
    """Hears a signal, and the target where that is `None`, until `verdict` is there.

    Its time 0 is the begin of the test (the first of `begin` and `update`), or else the target's own start. Samples
    may come in any order. They are kept until the verdict, up to MOST_SAMPLES of them, and the verdict then comes.
    """

    def __init__(self, signal: str, target: Target | None, limits: Limits, max_time: float, from_begin: bool) -> None:
        self.verdict: Verdict | None = None
        self._signal, self._target, self._limits = signal, target, limits
        self._max_time = max_time
        self._from_begin = from_begin or target is None
        self._samples, self._targets = Samples(), Samples()
        self._begun = False
        self._zero: int | None = None

    def begin(self, now: int) -> None:
        """The test begins; only the first call counts."""
        if not self._begun:
            self._begun, self._zero = True, now

    def hear(self, value: float, time: int) -> None:
        """A sample of the signal; not a finite number is a fault of the application."""
        if self.verdict is None:
            self._samples.add(time, value)

    def hear_target(self, value: float, time: int) -> None:
        """A sample of the target; raises UnjudgeableError where it is no finite number."""
        if not np.isfinite(value):
            raise UnjudgeableError(f"a sample of the target is {value}, expected a finite number")
        if self.verdict is None:
            self._targets.add(time, value)

    def update(self, now: int) -> None:
        """Look at the time; raises UnjudgeableError when it is over and there is no target."""
        elapsed = self._elapsed(now)
        if self.verdict is None and elapsed > self._max_time:
            self._decide(f"within {self._max_time:.2f} s")
        elif self.verdict is None and max(len(self._samples), len(self._targets)) >= MOST_SAMPLES:
            self._decide(f"in {elapsed:.2f} s, until memory was full")

    def end(self, now: int) -> None:
        """Nothing more will come: give the verdict now; raises as `update` does."""
        if self.verdict is None:
            self._decide(f"before the input ended after {self._elapsed(now):.2f} s")

    def _elapsed(self, now: int) -> float:
        if self._zero is None:
            self._zero = now
        return (now - self._zero) / MICROSECONDS

    def _decide(self, during: str) -> None:
        begin = self._zero or 0
        target = self._target or in_order(*self._targets.since(begin))
        if not len(target.times):
            raise UnjudgeableError(f"no sample of the target came {during}")
        times, values = self._samples.since(begin if self._from_begin else target.start)
        self.verdict = verdict(self._signal, target, measure(target, times, values, self._limits), self._limits, during)
