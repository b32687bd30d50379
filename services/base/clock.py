"""The injected clock: it alone decides when a service is updated and what time it is in the test."""

import logging
import time
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Protocol

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory

MICROSECONDS = 1_000_000
LATEST = MICROSECONDS
_SLICE = 0.1
_MAX_DRAINED = 1000

_log = logging.getLogger(__name__)


class Inbox(Protocol):
    """What others sent. A clock takes every envelope and hands on those that the service is to see."""

    def receive(self, timeout: float) -> Envelope | None:
        """The next envelope that comes within so many seconds."""
        ...

    def handle(self, envelope: Envelope) -> None:
        """Let the service have it."""
        ...

    @property
    def observes(self) -> bool:
        """Whether the service looks at all that is on the bus."""
        ...

    @property
    def hears(self) -> frozenset[int]:
        """Ids of the messages that it is to see at least."""
        ...

    def overhear(self, envelope: Envelope) -> None:
        """It is on the bus, but the service is not to act upon it."""
        ...


class Clock(Protocol):
    """Test time, in microseconds since the epoch. ``relays`` says that it hands on what was on the bus before."""

    relays: bool

    @property
    def is_showing(self) -> bool:
        """Whether there is a picture that nobody was told of yet."""
        ...

    def now(self) -> int:
        """The time of the test."""
        ...

    def steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        """The instants at which a service is due, one each ``period`` microseconds; messages come in between.

        Ends soon after ``stopped``, which a message or a signal can make true.
        """
        ...

    def sent(self, frame: bytes) -> None:
        """The service has sent this."""
        ...

    def expect(self, time: int) -> None:
        """The service will show something at this time (us) and nothing before it; 0 when it does not know."""
        ...

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory for pictures that are sampled by this clock; raises SharedMemoryError."""
        ...

    def close(self, stopped: Callable[[], bool]) -> None:
        """The service ends; what pictures it leaves behind can be looked at until ``stopped``."""
        ...


class RealTimeClock:
    """Test time is the wall clock's at the start, and goes on evenly whatever that is set to afterwards.

    Steps are the scheduled instants, not the moments at which the processor got to them: a service that is late
    catches up with the same times that it would have had, and skips steps only when it is more than 1 s late.
    """

    relays = False
    is_showing = False

    def __init__(self) -> None:
        self._offset = time.time_ns() // 1000 - time.monotonic_ns() // 1000

    def now(self) -> int:
        return time.monotonic_ns() // 1000 + self._offset

    def steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        start, number = self.now(), 0
        while True:
            due = start + round(number * period)
            self._wait(due, inbox, stopped)
            if stopped():
                return
            yield due
            number += 1
            number += self._skipped(start + round(number * period), period)

    def sent(self, frame: bytes) -> None:
        """Time goes on by itself."""

    def expect(self, time: int) -> None:
        """Time goes on evenly, whatever comes."""

    def memory(self, name: str, size: int) -> SharedMemory:
        return SharedMemory.create(name, size)

    def close(self, stopped: Callable[[], bool]) -> None:
        """Nobody waits."""

    def _wait(self, due: int, inbox: Inbox, stopped: Callable[[], bool]) -> None:
        """Deliver until the instant has come, and then what else is there already."""
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
        _log.warning("%.1f s late: %d steps are skipped", late / MICROSECONDS, steps)
        return steps


def _deliver(inbox: Inbox, timeout: float) -> bool:
    envelope = inbox.receive(timeout)
    if envelope is not None:
        inbox.handle(envelope)
    return envelope is not None
