"""The injected clock: it alone decides when a service is updated and what time it is in the test."""

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.shared_memory import SharedMemory

if TYPE_CHECKING:
    from services.base.loop import Loop

MICROSECONDS = 1_000_000
LATEST = MICROSECONDS
_SLICE = 0.1
_MAX_DRAINED = 1000

_log = logging.getLogger(__name__)


class Clock(ABC):
    """Test time, in microseconds since the epoch.

    ``relays``: messages come from the clock, not from the bus, and are sent at the test's time.
    """

    relays = False

    @property
    def has_new_picture(self) -> bool:
        return False

    @abstractmethod
    def now(self) -> int:
        """The time of the test."""

    @abstractmethod
    def steps(self, period: Fraction | int, inbox: "Loop", stopped: Callable[[], bool]) -> Iterator[int]:
        """The instants at which a service is due, one each ``period`` microseconds; messages come in between.

        Ends soon after ``stopped``, which a message or a signal can make true.
        """

    def sent(self, envelope: Envelope) -> None:  # noqa: B027  (most clocks have nothing to do)
        """The service has sent this message."""

    def expect(self, time: int) -> None:  # noqa: B027  (most clocks have nothing to do)
        """The service will show its next picture at this time (us) and none before; 0 when it does not know."""

    @abstractmethod
    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory for pictures that are sampled by this clock; raises SharedMemoryError."""

    def close(self, stopped: Callable[[], bool]) -> None:  # noqa: B027  (most clocks have nothing to do)
        """The service ends; its last pictures can be read until ``stopped``."""


class RealTimeClock(Clock):
    """Test time is the wall clock's at the start, and goes on evenly even if that is set.

    Steps are the scheduled instants, not the moments at which the processor got to them: a service that is late
    catches up with the times that it would have had, and skips steps only when it is more than 1 s late.
    """

    _has_memory = False

    def __init__(self) -> None:
        self._offset = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def now(self) -> int:
        return time.monotonic_ns() // 1000 + self._offset

    def steps(self, period: Fraction | int, inbox: "Loop", stopped: Callable[[], bool]) -> Iterator[int]:
        start, number = self.now(), 0
        while True:
            due = start + round(number * period)
            self._wait(due, inbox, stopped)
            if stopped():
                return
            yield due
            number += 1
            number += self._skipped(start + round(number * period), period)

    def memory(self, name: str, size: int) -> SharedMemory:
        self._has_memory = True
        return SharedMemory.create(name, size)

    def close(self, stopped: Callable[[], bool]) -> None:
        """Wait until ``stopped`` where there are pictures: an application must not lose them while it is judged."""
        if self._has_memory:
            look_until(stopped)

    def _wait(self, due: int, inbox: "Loop", stopped: Callable[[], bool]) -> None:
        while (left := due - self.now()) > 0 and not stopped():
            _deliver(inbox, min(left / MICROSECONDS, _SLICE))
        for _ in range(_MAX_DRAINED):
            if stopped() or not _deliver(inbox, 0.0):
                break

    def _skipped(self, due: int, period: Fraction | int) -> int:
        late = self.now() - due
        if late <= LATEST:
            return 0
        steps = int(late // period)
        _log.warning("%.1f s late, skipped %d steps", late / MICROSECONDS, steps)
        return steps


def look_until(is_over: Callable[[], bool], pause: float = 0.001, longest: float = _SLICE) -> None:
    """Look less and less often, where the kernel gives no notice, until it is over; a signal ends no pause."""
    while not is_over():
        time.sleep(pause)
        pause = min(1.5 * pause, longest)


def _deliver(inbox: "Loop", timeout: float) -> bool:
    envelope = inbox.receive(timeout)
    if envelope is not None:
        inbox.handle(envelope)
    return envelope is not None
