"""The clock of a service in lockstep: the time of the test goes on when the clock service says so, and no further.

What a service hears comes inside the step message and nowhere else, and what it says goes back inside the answer, so
that no lost or late datagram can change a result (``docs/lockstep.md``).
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import NamedTuple

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory
from services.base.clock import Inbox
from services.base.lockstep.announced_memory import AnnouncedMemory, Screen
from services.base.lockstep.clock_client import Ear, Reply
from services.base.lockstep.datagrams import STEP_DONE, cut
from services.base.lockstep.observer import EPOCH, LONGEST, Observed

__all__ = ["EPOCH", "LockstepClock"]

_GOODBYES = 10
_LINGER_S = 0.05


class Order(NamedTuple):
    """What the clock wants: go on to ``time``, knowing what was ``heard``; ``show`` the pictures that are new."""

    number: int
    time: int
    show: bool
    heard: list[Envelope]


class LockstepClock:
    """Test time as the clock service deals it out; ``name`` is the service's name in the test."""

    relays = True

    def __init__(self, session: Session, name: str, readers: int) -> None:
        self._session, self._name = session, name
        self._done = session.messages.type(STEP_DONE)
        self._ear = Ear(session, name)
        self._now = EPOCH - 1
        self._number = -1
        self._open = False
        self._sent: list[bytes] = []
        self._screen = Screen(readers)
        self._observed = Observed()
        self._next = 0
        self._hears = ""

    def now(self) -> int:
        return self._now

    @property
    def is_showing(self) -> bool:
        return bool(self._screen.new)

    def steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        """As ``Clock.steps``; messages are delivered in the order of their sample times."""
        self._hears = "" if inbox.observes else ",".join(map(str, sorted(inbox.hears)))
        yield from self._steps(period, inbox, stopped)
        if inbox.observes:
            self._observed.rest(inbox)

    def _steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        number, due = 0, EPOCH
        while (order := self._next_order(inbox, stopped)) is not None:
            if inbox.observes:
                self._observed.look(inbox, order.time, order.heard)
            heard = in_order(order.heard)
            while due <= order.time:
                while heard and heard[0][0] <= due:
                    inbox.handle(heard.popleft()[1])
                if stopped():
                    return
                self._now = due
                yield due
                number += 1
                due = EPOCH + round(number * period)
            self._now = order.time
            for _, envelope in heard:
                inbox.handle(envelope)
            if stopped() or (order.show and not self._screen.await_readers(stopped)):
                return
            self._answer(order.show)

    def sent(self, frame: bytes) -> None:
        """The service has sent this."""
        self._sent.append(frame)

    def expect(self, time: int) -> None:
        """The test then goes on to this time in one step."""
        self._next = time

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory whose pictures are announced once, when their readers wait for them."""
        memory = AnnouncedMemory.create(name, size)
        self._screen.memories.append(memory)
        return memory

    def close(self, stopped: Callable[[], bool]) -> None:
        """The service ends: the step that it is in is answered, and its answer has arrived.

        Its memories stay until the test is over, as removing them would show the last picture once more.
        """
        if self._open:
            self._open = False
            self._ear.answer(self._reply(ended=True))
            for _ in range(_GOODBYES):
                if self._ear.is_acknowledged():
                    break
                self._ear.repeat()
        self._ear.close()
        while self._screen.memories and not stopped():
            time.sleep(_LINGER_S)

    def _next_order(self, inbox: Inbox, stopped: Callable[[], bool]) -> Order | None:
        """The next step that is for this service; None when it is to stop."""
        while not stopped():
            step = self._ear.listen(inbox.observes, self._observed.overhear)
            if step is not None:
                self._number, self._open = step.number, True
                return Order(step.number, step.time, step.show, [said.envelope for said in step.heard])
        return None

    def _answer(self, show: bool) -> None:
        """A picture is announced behind the answer, so that all that its readers say stands behind that, too."""
        self._open = False
        self._ear.answer(self._reply(ended=False), on_the_bus=show)
        if show:
            self._screen.announce()

    def _reply(self, ended: bool) -> Reply:
        pieces = cut(self._sent)
        self._sent = []
        facts = {
            "number": self._number,
            "service": self._name,
            "parts": len(pieces),
            "memories": len(self._screen.memories),
            "pictures": len(self._screen.new),
            "sampled": self._screen.sampled,
            "ended": ended,
            "next": self._next,
            "port": self._session.port,
            "hears": self._hears,
        }
        self._hears = ""
        return [self._done(part=part, frames=data, **facts) for part, data in enumerate(pieces)]


def in_order(heard: Iterable[Envelope]) -> deque[tuple[int, Envelope]]:
    """Messages by when they are due: at their sample time, or, if that is none of the test's, behind those before."""
    due, timed = EPOCH, []
    for envelope in heard:
        if EPOCH <= envelope.sample_time <= EPOCH + LONGEST:
            due = envelope.sample_time
        timed.append((due, envelope))
    return deque(sorted(timed, key=lambda each: each[0]))
