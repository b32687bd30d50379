"""Orders to services and their answers, over the bus and beside it: sent again until each is answered."""

import select
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.codec import MessageError
from services.base.lockstep.channel import Channel
from services.base.lockstep.datagrams import STEP, STEP_DONE, Pieces, Said, cut, frames

REPEAT_S = 0.2
_SLICE = 0.05
_BURST = 2


class Order(NamedTuple):
    """What a service is to do: go on to ``time`` (us) with what it has to hear, or show its new pictures."""

    service: str
    time: int
    heard: tuple[Said, ...] = ()
    show: bool = False


class Done(NamedTuple):
    """What a service says of a step: what it sent, its memories, new pictures and when they were sampled."""

    service: str
    sent: tuple[Said, ...] = ()
    memories: int = 0
    pictures: int = 0
    sampled: int = 0
    ended: bool = False
    next: int = 0
    hears: frozenset[int] = frozenset()
    """Ids of the messages that it hears; none where it does not say."""


@dataclass
class _Asked:
    """Steps on their way to a service."""

    number: int
    messages: list[Any]
    repeat: float = 0.0


class Exchange:
    """Talks with the services; everything of others goes to ``hear``."""

    def __init__(self, session: Session, channel: Channel, hear: Callable[[Envelope], None]) -> None:
        self._session, self._channel, self._hear = session, channel, hear
        self._step = session.messages.type(STEP)
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._number = 0
        self._asked: dict[str, _Asked] = {}
        self._done: dict[str, Done] = {}
        self._pieces: dict[str, Pieces] = {}
        self._addresses: dict[str, Address] = {}
        self._own: set[Address] = set()
        self._channel_poll, self._poll = select.poll(), select.poll()
        for poll in (self._channel_poll, self._poll):
            poll.register(channel, select.POLLIN)
        self._poll.register(session, select.POLLIN)

    def ask(self, orders: Iterable[Order]) -> None:
        """Send the orders; they are sent again by ``pump``."""
        for order in orders:
            self._number += 1
            self._asked[order.service] = _Asked(self._number, self._messages(order))
        self._repeat()

    def answer(self, service: str) -> Done | None:
        """What a service that was asked has answered, once."""
        return self._done.pop(service, None)

    def forget(self) -> None:
        """Nobody is asked any more."""
        self._asked.clear()

    def pump(self, timeout: float, bus: bool = True) -> None:
        """Take what has come, or comes within ``timeout`` seconds, on the channel and maybe on the bus.

        Of the bus it is one message only, as the order of answers and the application's messages counts.
        """
        came = self._channel.receive()
        if came is not None:
            self._take(*came)
        elif not (bus and self._listen()):
            poll = self._poll if bus else self._channel_poll
            if not poll.poll(max(0.0, min(timeout, _SLICE)) * 1000):
                self._repeat()

    def tell(self, said: Iterable[Said]) -> None:
        """Say again, on the bus, what others have said."""
        for each in said:
            self._session.send_envelope(each.envelope)

    def drain(self) -> None:
        """Take everything that is on the bus already."""
        while self._listen():
            pass

    def _listen(self) -> bool:
        envelope = self._session.receive(0.0)
        if envelope is None:
            return False
        if envelope.data_type == self._done_id:
            self._take(envelope, None)
        elif envelope.data_type != self._step_id and self._session.source not in self._own:
            self._hear(envelope)
        return True

    def _repeat(self) -> None:
        """Each time the pieces begin with others, as a receive buffer may hold a few of them only."""
        now = time.monotonic()
        for name, asked in self._asked.items():
            if now >= asked.repeat:
                asked.repeat = now + REPEAT_S
                for message in asked.messages:
                    self._channel.send(message, self._addresses.get(name))
                asked.messages = [*asked.messages[_BURST:], *asked.messages[:_BURST]]

    def _messages(self, order: Order) -> list[Any]:
        pieces = cut(said.frame for said in order.heard)
        facts = {"number": self._number, "service": order.service, "time": order.time, "show": order.show}
        return [self._step(part=part, parts=len(pieces), frames=data, **facts) for part, data in enumerate(pieces)]

    def _take(self, envelope: Envelope, address: Address | None) -> None:
        """A piece of an answer; those of a service that ends are acknowledged, as it waits for that."""
        if envelope.data_type != self._done_id:
            return
        try:
            done: Any = self._session.messages.decode(envelope.data_type, envelope.payload)
            if done.ended and address is not None:
                self._channel.send(self._step(number=done.number, service=done.service), address)
            asked = self._asked.get(done.service)
            if asked is None or asked.number != done.number:
                return
            if address is not None:
                self._addresses[done.service] = address
                self._own.add((address[0], done.port))
            data = self._pieces.setdefault(done.service, Pieces()).take(done.number, done.part, done.parts, done.frames)
            if data is not None:
                hears = frozenset(int(word) for word in done.hears.split(",") if word.isdecimal())
                facts = (done.memories, done.pictures, done.sampled, done.ended, done.next, hears)
                self._done[done.service] = Done(done.service, tuple(frames(data)), *facts)
                del self._asked[done.service]
        except (FrameError, MessageError):
            return  # not from one of ours
