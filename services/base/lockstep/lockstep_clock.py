"""The clock of a service in lockstep: the clock service alone advances the time of the test.

What a service consumes comes inside the step message and nowhere else, and what it produces goes back inside the
answer, so that no lost or late datagram can change a result (``docs/explanation/lockstep.md``).
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Protocol

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory
from services.base.clock import Inbox
from services.base.lockstep.announced_memory import AnnouncedMemory, Announcer
from services.base.lockstep.clock_client import ClockClient, Reply, Step
from services.base.lockstep.datagrams import STEP_DONE, split
from services.base.lockstep.observer import EPOCH, LONGEST, Observer
from services.base.recorded.step_marks import StepMarks

__all__ = ["EPOCH", "LockstepClock"]

_GOODBYES = 10
_LINGER_S = 0.05


class StepSource(Protocol):
    """Where steps come from and their answers go, as ClockClient implements it; ``is_over`` when no more will come."""

    is_over: bool

    def next_step(self, observes: bool, observe: Callable[[Envelope], None]) -> Step | None: ...
    def answer(self, reply: Reply, on_the_bus: bool = False) -> None: ...
    def repeat(self) -> None: ...
    def is_acknowledged(self) -> bool: ...
    def close(self) -> None: ...


class LockstepClock:
    """Test time in the clock service's steps; ``name`` is the service's name in the test.

    Steps come from ``source``, by default from the clock service, which has the ``key`` of the test.
    """

    relays = True

    def __init__(
        self, session: Session, name: str, readers: int, source: StepSource | None = None, key: bytes = b""
    ) -> None:
        self._session, self._name = session, name
        self._step_done = session.messages.type(STEP_DONE)
        self._client: StepSource = source or ClockClient(session, name, key)
        self._now = EPOCH - 1
        self._number = -1
        self._open = False
        self._sent: list[bytes] = []
        self._announcer = Announcer(readers)
        self._observer = Observer(StepMarks(session.messages).of)
        self._next = 0
        self._consumed = ""

    def now(self) -> int:
        return self._now

    @property
    def has_new_picture(self) -> bool:
        return bool(self._announcer.new)

    def steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        """As ``Clock.steps``; messages are delivered in the order of their sample times."""
        self._consumed = "" if inbox.observes else ",".join(map(str, sorted(inbox.consumes)))
        yield from self._steps(period, inbox, stopped)
        if inbox.observes:
            self._observer.flush(inbox)

    def _steps(self, period: Fraction | int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        number, due = 0, EPOCH
        while (step := self._next_step(inbox, stopped)) is not None:
            if inbox.observes:
                self._observer.deliver(inbox, step.time, step.messages)
            messages = in_order(step.messages)
            while due <= step.time:
                while messages and messages[0][0] <= due:
                    inbox.handle(messages.popleft()[1])
                if stopped():
                    return
                self._now = due
                yield due
                number += 1
                due = EPOCH + round(number * period)
            self._now = step.time
            for _, envelope in messages:
                inbox.handle(envelope)
            if stopped() or (step.show and not self._announcer.await_readers(stopped)):
                return
            self._answer(step.show)

    def sent(self, frame: bytes) -> None:
        """The service has sent this frame."""
        self._sent.append(frame)

    def expect(self, time: int) -> None:
        """The test may go on to this time in one step."""
        self._next = time

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory whose pictures are announced once, when their readers wait."""
        memory = AnnouncedMemory.create(name, size)
        self._announcer.memories.append(memory)
        return memory

    def close(self, stopped: Callable[[], bool]) -> None:
        """The service ends: answer the open step, and wait until the clock has the answer.

        Its memories stay until the test is over, as removing them would show the last picture once more.
        """
        if self._open:
            self._open = False
            self._client.answer(self._reply(ended=True))
            for _ in range(_GOODBYES):
                if self._client.is_acknowledged():
                    break
                self._client.repeat()
        self._client.close()
        while self._announcer.memories and not stopped():
            time.sleep(_LINGER_S)

    def _next_step(self, inbox: Inbox, stopped: Callable[[], bool]) -> Step | None:
        """The next step that is for this service; None when it is to stop."""
        while not (stopped() or self._client.is_over):
            step = self._client.next_step(inbox.observes, self._observer.collect)
            if step is not None:
                self._number, self._open = step.number, True
                return step
        return None

    def _answer(self, show: bool) -> None:
        """A picture is announced after the answer, so that its readers' messages come after that, too."""
        self._open = False
        self._client.answer(self._reply(ended=False), on_the_bus=show)
        if show:
            self._announcer.announce()

    def _reply(self, ended: bool) -> Reply:
        parts = split(self._sent)
        self._sent = []
        facts = {
            "number": self._number,
            "service": self._name,
            "parts": len(parts),
            "memories": len(self._announcer.memories),
            "pictures": len(self._announcer.new),
            "sampled": self._announcer.sampled,
            "ended": ended,
            "next": self._next,
            "port": self._session.port,
            "hears": self._consumed,
        }
        self._consumed = ""
        return [self._step_done(part=part, frames=data, **facts) for part, data in enumerate(parts)]


def in_order(messages: Iterable[Envelope]) -> deque[tuple[int, Envelope]]:
    """Messages by when they are due: at their sample time, or after those before if that is not of the test."""
    due, timed = EPOCH, []
    for envelope in messages:
        if EPOCH <= envelope.sample_time <= EPOCH + LONGEST:
            due = envelope.sample_time
        timed.append((due, envelope))
    return deque(sorted(timed, key=lambda each: each[0]))
