"""The injected clock: it alone decides when a service is updated and what time it is in the test."""

import logging
import time
from collections.abc import Callable, Iterator
from typing import Protocol

MICROSECONDS = 1_000_000
LATEST = MICROSECONDS
_SLICE = 0.1
_MAX_DRAINED = 1000

Deliver = Callable[[float], bool]
"""Hands the service one message that comes within so many seconds; False when none came."""


class Clock(Protocol):
    """Test time, in microseconds since the epoch."""

    def now(self) -> int: ...

    def steps(self, period: int, deliver: Deliver, stopped: Callable[[], bool]) -> Iterator[int]:
        """The instants at which a service is due, one each ``period`` microseconds; messages come in between."""
        ...


class RealTimeClock:
    """Test time is the wall clock's at the start, and goes on evenly whatever that is set to afterwards.

    Steps are the scheduled instants, not the moments at which the processor got to them: a service that is late
    catches up with the same times that it would have had, and skips steps only when it is more than 1 s late.
    """

    def __init__(self) -> None:
        self._offset = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def now(self) -> int:
        return time.monotonic_ns() // 1000 + self._offset

    def steps(self, period: int, deliver: Deliver, stopped: Callable[[], bool]) -> Iterator[int]:
        due = self.now()
        while True:
            while (left := due - self.now()) > 0 and not stopped():
                deliver(min(left / MICROSECONDS, _SLICE))
            for _ in range(_MAX_DRAINED):
                if stopped() or not deliver(0.0):
                    break
            if stopped():
                return
            yield due
            due += period
            due += self._skipped(due, period)

    def _skipped(self, due: int, period: int) -> int:
        late = self.now() - due
        if late <= LATEST:
            return 0
        steps = late // period
        logging.getLogger(__name__).warning("%.1f s late: %d steps are skipped", late / MICROSECONDS, steps)
        return steps * period
