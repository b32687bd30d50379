"""Samples whose times are not believed: holes must not be filled afterwards, nor the future be answered."""

from typing import NamedTuple

from services.base.evaluator import EARLY
from services.continuous_signal.target import MICROSECONDS


class Arrival(NamedTuple):
    """A sample's time and when it arrived, both in us."""

    time: int
    arrival: int


class LateFacts(NamedTuple):
    """How many samples were late, and the first of them: its time in s, and when it arrived where that says more."""

    samples: int = 0
    time: float = 0.0
    arrival: float | None = None


class LateSamples:
    """Samples are late whose time is more than ``delay`` us before their arrival; None believes all.

    Those of more than EARLY us after it are not believed, either.

    Where sample times are not those of the test (``is_test_time``), they are late when one came before them
    that is so much newer.
    """

    def __init__(self, delay: int | None, is_test_time: bool) -> None:
        self._delay, self._is_test_time = delay, is_test_time
        self._count = 0
        self._first: Arrival | None = None
        self.newest: Arrival | None = None
        """The newest sample that was believed."""

    def take(self, time: int, arrival: int | None) -> bool:
        """Whether a sample is late; nothing is before the time of the test is known (``arrival`` is None)."""
        if arrival is None:
            return False
        if self._is_late(time, arrival):
            self._count += 1
            self._first = self._first or Arrival(time, arrival)
            return True
        if self.newest is None or time >= self.newest.time:
            self.newest = Arrival(time, arrival)
        return False

    def facts(self, zero: int) -> LateFacts:
        """What was late, its times counted from ``zero`` us."""
        if self._first is None:
            return LateFacts()
        time, arrival = ((each - zero) / MICROSECONDS for each in self._first)
        return LateFacts(self._count, time, arrival if self._is_test_time else None)

    def _is_late(self, time: int, arrival: int) -> bool:
        if self._delay is None:
            return False
        if self._is_test_time:
            return arrival - time > self._delay or time - arrival > min(EARLY, self._delay)
        return self.newest is not None and self.newest.time - time > self._delay
