"""The clock of a service in lockstep: the time of the test goes on when the clock service says so, and no further.

What a service hears comes inside the step message and nowhere else, and what it says goes back inside the answer, so
that no lost or late datagram can change a result (``docs/lockstep.md``).
"""

import time
from collections.abc import Callable, Iterator

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.memory import SharedMemory
from dodo_dsl.opendlv.session import Session
from services.base.clock import Inbox
from services.base.parts import STEP, STEP_DONE, Pieces, cut, frames

EPOCH = 1_700_000_000_000_000
"""The time at which every test in lockstep begins, in microseconds since the epoch."""

_SLICE = 0.1
_LOOK = 0.0002


class AnnouncedMemory(SharedMemory):
    """Shared memory that leaves it to the clock to wake its readers."""

    news: "list[AnnouncedMemory]"

    def notify_all(self) -> None:
        """There is a new picture; the clock tells of it when the step has been answered."""
        if self not in self.news:
            self.news.append(self)


class LockstepClock:
    """Test time as the clock service deals it out; ``name`` is the service's name in the test."""

    relays = True

    def __init__(self, session: Session, name: str, readers: int) -> None:
        self._session, self._name, self._readers = session, name, readers
        self._step, self._done = (session.messages.type(kind) for kind in (STEP, STEP_DONE))
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._now = EPOCH
        self._pieces = Pieces()
        self._number = -1
        self._answer: list[object] = []
        self._sent: list[Envelope] = []
        self._memories: list[AnnouncedMemory] = []
        self._new: list[AnnouncedMemory] = []
        self.next = 0
        """When the service has something to say next, in us of test time; 0 when that is not known."""

    def now(self) -> int:
        return self._now

    def steps(self, period: int, inbox: Inbox, stopped: Callable[[], bool]) -> Iterator[int]:
        """As ``Clock.steps``; messages are delivered in the order of their sample times."""
        due = EPOCH
        while True:
            step = self._wait(inbox, stopped)
            if step is None:
                return
            until, heard = step
            heard.sort(key=lambda envelope: envelope.sample_time)
            waiting = iter(heard)
            envelope = next(waiting, None)
            while due <= until:
                while envelope is not None and envelope.sample_time <= due:
                    inbox.handle(envelope)
                    envelope = next(waiting, None)
                if stopped():
                    return
                self._now = due
                yield due
                due += period
            while envelope is not None:
                inbox.handle(envelope)
                envelope = next(waiting, None)
            self._now = until
            if stopped():
                return
            self._reply(ended=False)
            self._announce(stopped)

    def sent(self, envelope: Envelope) -> None:
        """The service has sent this."""
        self._sent.append(envelope)

    def close(self) -> None:
        """The service ends: the step that it is in is answered."""
        if self._number >= 0:
            self._reply(ended=True)

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory whose pictures are announced once, when their readers wait for them."""
        memory = AnnouncedMemory.create(name, size)
        memory.news = self._new
        self._memories.append(memory)
        return memory

    def _announce(self, stopped: Callable[[], bool]) -> None:
        """Tell of new pictures as soon as the readers wait, so that none is missed and none is read twice."""
        if not self._new:
            return
        while sum(memory.readers_waiting() for memory in self._memories) < self._readers:
            if stopped():
                return
            time.sleep(_LOOK)
        for memory in self._new:
            SharedMemory.notify_all(memory)
        self._new.clear()

    def _wait(self, inbox: Inbox, stopped: Callable[[], bool]) -> tuple[int, list[Envelope]] | None:
        """The next step that is for this service: its time, and what is to be heard; None when it is to stop."""
        while not stopped():
            envelope = inbox.receive(_SLICE)
            if envelope is None:
                continue
            if envelope.data_type != self._step_id:
                if envelope.data_type != self._done_id:
                    inbox.overhear(envelope)
                continue
            step = self._session.messages.decode(envelope.data_type, envelope.payload)
            if self._name not in step.services.split(","):
                continue
            if step.number == self._number:
                self._repeat()
                continue
            data = self._pieces.take(step.number, step.part, step.parts, step.frames)
            if data is not None:
                self._number = step.number
                return step.time, list(frames(data))
        return None

    def _reply(self, ended: bool) -> None:
        pieces = cut(self._sent)
        self._answer = [
            self._done(
                number=self._number, service=self._name, part=part, parts=len(pieces), frames=data,
                pictures=len(self._new), ended=ended, next=self.next,
            )
            for part, data in enumerate(pieces)
        ]  # fmt: skip
        self._sent = []
        self._repeat()

    def _repeat(self) -> None:
        for message in self._answer:
            self._session.send(message)  # type: ignore[arg-type]
