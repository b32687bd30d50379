"""Commands to services and their results, over the bus and beside it: repeated until each is answered."""

import select
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.numbers import is_whole, whole
from services.base.identity.senders import SenderTable
from services.base.identity.world import World
from services.base.lockstep.channel import ClockChannel
from services.base.lockstep.datagrams import STEP, STEP_DONE, EncodedEnvelope, Reassembly, decode, split

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
        elif source not in self._own and self._senders.is_of_runner(envelope):
            producers = self._senders.producers(envelope)
            if producers is None:
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
        """Part of a result; those of a service that ends are acknowledged, as it waits for that."""
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
                self._addresses.setdefault(done.service, address)  # who repeats an answer is not the service
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
