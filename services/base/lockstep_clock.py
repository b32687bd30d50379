"""The clock of a service in lockstep: the clock service alone advances the time of the test.

What a service consumes comes inside the step message and nowhere else, and what it produces goes back inside the
answer, so that no lost or late datagram can change a result (``docs/explanation/lockstep.md``).

A recording has marks of the steps. The messages of the test's services are in it as they were sent, ``received`` at 0,
behind the ``dodo.RecordedStep`` in which services got it. That holds the application's messages as the clock passed
them on: with the sample time of the frame, and without surplus answers. They are also in the recording as they were on
the bus, which does not count here.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from itertools import groupby
from typing import TYPE_CHECKING

from dodo_dsl.opendlv.channel import About, Done, Show, Step
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.posix_memory import PosixSegment
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import LOCK_PATIENCE, SharedMemory
from dodo_dsl.opendlv.sysv_memory import Segment
from services.base.clock import Clock, look_until
from services.base.clock_link import ClockClient

if TYPE_CHECKING:
    from services.base.loop import Loop

_POLL_S = 0.0002
_LONGEST_POLL_S = 0.002


class AnnouncedMemory(SharedMemory):
    """Shared memory that holds back the next picture, ``sampled`` at a time in us, until it is announced."""

    def __init__(self, segment: Segment | PosixSegment, name: str, owner: bool) -> None:
        super().__init__(segment, name, owner)
        self._shown = self.buffer
        self.buffer = memoryview(bytearray(self.size))
        self.is_new = False
        self.sampled = 0

    @contextmanager
    def lock(self, timeout: float = LOCK_PATIENCE) -> Iterator[None]:
        """No lock is needed: nobody else sees the next picture."""
        yield

    def stamp(self, time_us: int) -> None:
        self.sampled = time_us

    def notify_all(self) -> None:
        self.is_new = True

    def announce(self) -> None:
        """Show the picture, if there is a new one, and notify the readers."""
        if not self.is_new:
            return
        self.is_new = False
        with super().lock():
            self._shown[:] = self.buffer
            super().stamp(self.sampled)
            super().notify_all()

    def close(self) -> None:
        self._shown = memoryview(b"")
        super().close()


EPOCH = 1_700_000_000_000_000
"""The time at which every test in lockstep begins, in microseconds since the epoch."""

LONGEST = 2 * 86_400_000_000
"""Longest test, in microseconds."""

Observe = Callable[[Envelope], None]
RECORDED_STEP, RECORDING_END = "dodo.RecordedStep", "dodo.RecordingEnd"


class Observer:
    """Merges the messages of the test's services, which the clock passes on completely, with the rest of the bus.

    Messages of the application count as they are on the bus, not as the clock passes them on. Marks show in a recording
    how each step went: their sample time is that of the step before.
    """

    def __init__(self, messages: MessageSet) -> None:
        self._messages, self._type, self._id = messages, messages.type(RECORDED_STEP), messages.id(RECORDED_STEP)
        self._collected: list[Envelope] = []
        self._number = 0
        self._last = EPOCH

    def collect(self, envelope: Envelope) -> None:
        """Take what others than services sent on the bus."""
        self._collected.append(envelope)

    def deliver(self, observe: Observe, until: int, relayed: Sequence[Envelope]) -> None:
        """Deliver all of a step (its end ``until`` in us). The answer to it waits: whether it is there is chance."""
        collected, self._collected = self._collected, []
        for envelope in collected:
            if until <= envelope.sample_time <= EPOCH + LONGEST:
                self._collected.append(envelope)
            else:
                observe(envelope)
        for envelope in self._marked(until, relayed):
            observe(envelope)

    def flush(self, observe: Observe) -> None:
        """The test is over: deliver what waits for a step that will not come."""
        for envelope in self._collected:
            observe(envelope)
        self._collected = []

    def _marked(self, time: int, relayed: Sequence[Envelope]) -> Iterator[Envelope]:
        """What a recording holds of a step at ``time`` (us) that brought ``relayed``; one mark at least."""
        self._number += 1
        if not relayed or not relayed[0].received:
            yield self._mark(time, ())
        for is_own, group in groupby(relayed, key=lambda envelope: not envelope.received):
            messages = list(group)
            yield from messages if is_own else (self._mark(time, messages),)
        self._last = max(time, EPOCH)

    def _mark(self, time: int, others: Iterable[Envelope]) -> Envelope:
        message = self._type(number=self._number, time=time, frames=b"".join(map(encode_frame, others)))
        return Envelope(self._id, self._messages.encode(message), self._last, 0, self._last, 0)


class LockstepClock(Clock):
    """Test time in the clock service's steps, or a recording's; ``readers`` wait for pictures of all memories."""

    relays = True

    def __init__(self, session: Session, name: str, readers: int, client: ClockClient | None = None) -> None:
        self._name, self._readers = name, readers
        self._client = client or ClockClient(session, name)
        self._now = EPOCH - 1
        self._open = False
        self._sent: list[Envelope] = []
        self._memories: list[AnnouncedMemory] = []
        self._observer = Observer(session.messages)
        self._next = 0
        self._address = session.address
        self._about: About | None = None

    def now(self) -> int:
        return self._now

    @property
    def has_new_picture(self) -> bool:
        return any(memory.is_new for memory in self._memories)

    def _is_awaited(self) -> bool:
        """Whether all readers wait, so that none misses a picture or reads one twice."""
        return sum(memory.readers_waiting() for memory in self._memories) >= self._readers

    def steps(self, period: Fraction | int, inbox: "Loop", stopped: Callable[[], bool]) -> Iterator[int]:
        """As ``Clock.steps``; messages are delivered in the order of their sample times."""
        consumes = [] if inbox.observe else sorted(inbox.consumes)
        self._about = About(self._address, len(self._memories), consumes)
        yield from self._steps(period, inbox, stopped)
        if inbox.observe:
            self._client.drain(self._observer.collect)
            self._observer.flush(inbox.observe)

    def _steps(self, period: Fraction | int, inbox: "Loop", stopped: Callable[[], bool]) -> Iterator[int]:
        number, due = 0, EPOCH
        while (command := self._command(inbox, stopped)) is not None:
            if isinstance(command, Show):
                if not self._show(command, stopped):
                    return
                continue
            if inbox.observe:
                self._observer.deliver(inbox.observe, command.time, command.messages)
            messages = in_order(command.messages)
            while due <= command.time:
                while messages and messages[0][0] <= due:
                    self._hand(messages.popleft()[1], inbox)
                if stopped():
                    return
                self._now = due
                yield due
                number += 1
                due = EPOCH + round(number * period)
            self._now = command.time
            for _, envelope in messages:
                self._hand(envelope, inbox)
            if stopped():
                return
            self._answer()

    def _show(self, command: Show, stopped: Callable[[], bool]) -> bool:
        if command.awaits:
            look_until(lambda: self._is_awaited() or stopped(), _POLL_S, _LONGEST_POLL_S)
            if not self._is_awaited():
                return False
        if command.announces:
            for memory in self._memories:
                memory.announce()
        self._answer()
        return True

    def _hand(self, envelope: Envelope, inbox: "Loop") -> None:
        """Where the application's time is the test's, the service learns when it was sent."""
        now = self._now
        self._now = envelope.received if _is_of_test(envelope.received) else now
        inbox.handle(envelope)
        self._now = now

    def sent(self, envelope: Envelope) -> None:
        self._sent.append(envelope)

    def expect(self, time: int) -> None:
        self._next = time

    def memory(self, name: str, size: int) -> SharedMemory:
        memory = AnnouncedMemory.create(name, size)
        self._memories.append(memory)
        return memory

    def close(self, stopped: Callable[[], bool]) -> None:
        """Answer the open step. Memories stay until the test is over, else the last picture were shown once more."""
        if self._open:
            self._answer(ended=True)
        self._client.close()
        if self._memories:
            look_until(stopped)

    def _command(self, inbox: "Loop", stopped: Callable[[], bool]) -> Step | Show | None:
        observe = self._observer.collect if inbox.observe else None
        with suppress(EOFError):
            while not stopped():
                if command := self._client.next(observe):
                    self._open = True
                    return command
        return None

    def _answer(self, ended: bool = False) -> None:
        sent, about, memories = self._sent, self._about, self._memories
        self._sent, self._about, self._open = [], None, False
        pictures = sum(memory.is_new for memory in memories)
        sampled = max((memory.sampled for memory in memories), default=0)
        awaited = bool(memories) and self._is_awaited()
        self._client.answer(Done(self._name, sent, pictures, sampled, self._next, ended, about, awaited))


def in_order(messages: Iterable[Envelope]) -> deque[tuple[int, Envelope]]:
    """Messages by when they are due: at their sample time, or after those before if that is not of the test.

    Where the application's time is the test's, its messages are due when it sent them.
    """
    due, timed = EPOCH, []
    for envelope in messages:
        if _is_of_test(envelope.received):
            due = envelope.received
        elif _is_of_test(envelope.sample_time):
            due = envelope.sample_time
        timed.append((due, envelope))
    return deque(sorted(timed, key=lambda each: each[0]))


def _is_of_test(time_us: int) -> bool:
    return EPOCH <= time_us <= EPOCH + LONGEST
