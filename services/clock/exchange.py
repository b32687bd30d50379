"""Commands of the clock to the services of a test: repeated until each is answered; and how a test can end.

Commands and results go over the bus and past it.
"""

import select
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from dodo_dsl.opendlv.address import LINES, Address
from dodo_dsl.opendlv.envelope import Envelope, FrameError
from dodo_dsl.opendlv.message_set import MessageError
from dodo_dsl.opendlv.numbers import is_whole, whole
from dodo_dsl.opendlv.session import Session
from services.base.clock_link import STEP, STEP_DONE, ClockChannel, EncodedEnvelope, Reassembly, decode, split
from services.base.members import SENDER, SenderTable, World

REPEAT_S = 0.2
_SLICE = 0.05
_BURST = 2


class StepCommand(NamedTuple):
    """What a service has to do: go on to ``time`` (us) with these messages, or show its new pictures."""

    service: str
    time: int
    messages: tuple[EncodedEnvelope, ...] = ()
    show: bool = False


class StepResult(NamedTuple):
    """A service's step: what it sent, its number of memories and new pictures, and when these were sampled."""

    service: str
    sent: tuple[EncodedEnvelope, ...] = ()
    memories: int = 0
    pictures: int = 0
    sampled: int = 0
    ended: bool = False
    next: int = 0
    consumes: frozenset[int] = frozenset()
    """Ids of the messages that it handles; empty where unknown."""


@dataclass
class _Pending:
    """A command that is not answered yet."""

    number: int
    messages: list[Any]
    repeat: float = 0.0


class Exchange:
    """Commands the services; messages of all others on the bus go to ``take``, if ``senders`` let them send those."""

    def __init__(
        self,
        session: Session,
        channel: ClockChannel,
        take: Callable[[Envelope], None],
        senders: SenderTable | None = None,
    ) -> None:
        self._session, self._channel, self._take_other = session, channel, take
        self._senders = senders or SenderTable(session.messages)
        self._world = World.load(session.messages)
        self._step = session.messages.type(STEP)
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._sender_id = session.messages.id(SENDER)
        self._printing: Address | None = None
        """From where the runner sends what the application prints; the first one that proves it."""
        self._number = 0
        self._pending: dict[str, _Pending] = {}
        self._results: dict[str, StepResult] = {}
        self._reassembly: dict[str, Reassembly] = {}
        self._addresses: dict[str, Address] = {}
        self._own: set[Address] = set()
        self._channel_poll, self._poll = select.poll(), select.poll()
        for poll in (self._channel_poll, self._poll):
            poll.register(channel, select.POLLIN)
        self._poll.register(session, select.POLLIN)

    def send(self, commands: Iterable[StepCommand]) -> None:
        """Send commands; ``pump`` repeats them."""
        for command in commands:
            self._number += 1
            self._pending[command.service] = _Pending(self._number, self._messages(command))
        self._repeat()

    def result(self, service: str) -> StepResult | None:
        """A service's answer to its command, once."""
        return self._results.pop(service, None)

    def clear(self) -> None:
        """Stop repeating commands."""
        self._pending.clear()

    def pump(self, timeout: float, bus: bool = True) -> None:
        """Take what comes within ``timeout`` seconds on the channel, and on the ``bus``.

        Of the bus it takes one message only, as the order of results and the application's messages counts.
        """
        received = self._channel.receive()
        if received is not None:
            self._take(*received)
        elif not (bus and self._take_from_bus()):
            poll = self._poll if bus else self._channel_poll
            if not poll.poll(max(0.0, min(timeout, _SLICE)) * 1000):
                self._repeat()

    def repeat_on_bus(self, messages: Iterable[EncodedEnvelope]) -> None:
        """Send messages of services on the bus again, but for those that are not for the application."""
        for each in messages:
            if not self._world.holds(each.envelope):
                self._session.send_envelope(each.envelope)

    def drain(self) -> None:
        """Take everything that is on the bus already."""
        while self._take_from_bus():
            pass

    def _take_from_bus(self) -> bool:
        envelope = self._session.receive(0.0)
        if envelope is None:
            return False
        self.hear(envelope, self._session.source)
        return True

    def hear(self, envelope: Envelope, source: Address) -> None:
        """Take a message from the bus; the addresses of all services are known."""
        if envelope.data_type in (self._step_id, self._done_id):
            if not self._channel.believes(envelope):
                name = STEP if envelope.data_type == self._step_id else STEP_DONE
                self._senders.report(f"the application sent {name}, which only services of the test may send")
            elif envelope.data_type == self._done_id:
                self._take(envelope, None)
        elif envelope.data_type == self._sender_id:
            if self._printing is None and self._senders.is_of(LINES, envelope, source):
                self._printing = source
        elif source not in self._own and self._senders.is_of_runner(envelope):
            producers = self._senders.producers(envelope)
            if producers is None or (LINES in producers.services and source == self._printing):
                self._take_other(envelope)
            else:
                self._senders.report(producers.reason)

    def ignore_services(self, ids: Iterable[int]) -> None:
        """Not be woken by messages with these ids that services send on the bus: all of them are known now."""
        self._session.hear_only((self._step_id, self._done_id), ids, self._own)

    def _repeat(self) -> None:
        """Each time begins with other parts, as a receive buffer may hold only a few of them."""
        now = time.monotonic()
        for name, pending in self._pending.items():
            if now >= pending.repeat:
                pending.repeat = now + REPEAT_S
                for message in pending.messages:
                    self._channel.send(message, self._addresses.get(name))
                pending.messages = [*pending.messages[_BURST:], *pending.messages[:_BURST]]

    def _messages(self, command: StepCommand) -> list[Any]:
        parts = split(encoded.frame for encoded in command.messages)
        facts = {"number": self._number, "service": command.service, "time": command.time, "show": command.show}
        return [self._step(part=part, parts=len(parts), frames=data, **facts) for part, data in enumerate(parts)]

    def _take(self, envelope: Envelope, address: Address | None) -> None:
        """Part of a result; those of a service that ends are acknowledged, because it waits for that."""
        if envelope.data_type != self._done_id:
            return
        try:
            done: Any = self._session.messages.decode(envelope.data_type, envelope.payload)
            if done.ended and address is not None:
                self._channel.send(self._step(number=done.number, service=done.service), address)
            pending = self._pending.get(done.service)
            if pending is None or pending.number != done.number:
                return
            if address is not None:
                self._addresses.setdefault(done.service, address)  # a repeated answer is not the service's
                self._own.add((address[0], done.port))
            data = self._reassembly.setdefault(done.service, Reassembly()).take(
                done.number, done.part, done.parts, done.frames
            )
            if data is not None:
                consumes = frozenset(whole(word) for word in done.hears.split(",") if is_whole(word))
                facts = (done.memories, done.pictures, done.sampled, done.ended, done.next, consumes)
                self._results[done.service] = StepResult(done.service, tuple(decode(data)), *facts)
                del self._pending[done.service]
        except (FrameError, MessageError):
            return  # not from a service of this test


SLICE_S = 0.05
"""How often the clock checks whether it has to stop."""


class TestEnded(Exception):
    """The test cannot go on; one sentence. ``kind`` names the reason in the protocol."""

    kind = ""


class ApplicationSilent(TestEnded):
    """The application did not answer in time."""

    kind = "unanswered"


class ApplicationFloods(TestEnded):
    """The application sends far more than it is asked for."""

    kind = "unanswered"


class ServiceSilent(TestEnded):
    """A service of the test does not answer the clock."""

    kind = "stuck"


class TimeOver(TestEnded):
    """The test time is over."""

    kind = "timedout"


class ServiceLink(Protocol):
    """Commands to the services and their results, as Exchange implements it."""

    def send(self, commands: Iterable[StepCommand]) -> None: ...
    def result(self, service: str) -> StepResult | None: ...
    def clear(self) -> None: ...
    def pump(self, timeout: float, bus: bool = True) -> None: ...
    def repeat_on_bus(self, messages: Iterable[EncodedEnvelope]) -> None: ...
    def drain(self) -> None: ...


IsStopped = Callable[[], bool]
"""Whether the clock has to stop."""


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` step in order, ``judge`` and ``watch`` alongside."""

    advance: tuple[str, ...]
    sense: tuple[str, ...]
    judge: tuple[str, ...]
    watch: tuple[str, ...] = ()

    @property
    def all(self) -> tuple[str, ...]:
        return (*self.advance, *self.sense, *self.judge, *self.watch)


@dataclass
class Patience:
    """Wall time in s that the application has for the first frame, and for each other one.

    What it waited for a processor meanwhile does not count: others are to blame for that.
    """

    first: float
    others: float


@dataclass(frozen=True)
class Timing:
    """``period`` and ``timeout`` in us of test time; answers are counted that take longer than ``max_response`` s."""

    period: Fraction | int
    timeout: int
    patience: Patience
    max_response: float | None = None
