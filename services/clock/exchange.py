"""Orders to services and their answers, over the bus and beside it: sent again until each is answered."""

import select
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from dodo_dsl.opendlv.codec import MessageError
from dodo_dsl.opendlv.envelope import Envelope, FrameError
from dodo_dsl.opendlv.session import Address, Session
from services.base.channel import Channel
from services.base.parts import STEP, STEP_DONE, Pieces, Said, cut, frames

REPEAT_S = 0.2
_SLICE = 0.05


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


class Exchange:
    """Talks with the services; everything of others goes to ``hear``. ``over`` says that the test is to end."""

    def __init__(
        self, session: Session, channel: Channel, hear: Callable[[Envelope], None], over: Callable[[], bool]
    ) -> None:
        self._session, self._channel, self._hear, self._over = session, channel, hear, over
        self._step = session.messages.type(STEP)
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._number = 0
        self._waiting: dict[str, int] = {}
        self._done: dict[str, Done] = {}
        self._pieces: dict[str, Pieces] = {}
        self._addresses: dict[str, Address] = {}
        self._own: set[Address] = set()
        self._poll = select.poll()
        self._poll.register(channel, select.POLLIN)
        self._poll.register(session, select.POLLIN)

    def run(self, orders: Sequence[Order], deadline: float) -> list[Done]:
        """The answers in the order of the orders; those that did not come until ``deadline`` (monotonic) lack."""
        messages = {order.service: self._messages(order) for order in orders}
        self._done, self._waiting = {}, {name: m[0].number for name, m in messages.items()}
        repeat = 0.0
        while self._waiting and not self._over():
            now = time.monotonic()
            if now >= deadline:
                break
            if now >= repeat:
                for name in self._waiting:
                    for message in messages[name]:
                        self._channel.send(message, self._addresses.get(name))
                repeat = now + REPEAT_S
            self.pump(min(repeat, deadline) - now)
        self._waiting = {}
        return [self._done[order.service] for order in orders if order.service in self._done]

    def pump(self, timeout: float) -> None:
        """Take what has come, or comes within ``timeout`` seconds; of the bus only one message, so that the order
        in which answers and the application's messages came counts."""
        came = self._channel.receive()
        if came is not None:
            self._take(*came)
            return
        envelope = self._session.receive(0.0)
        if envelope is None:
            self._poll.poll(max(0.0, min(timeout, _SLICE)) * 1000)
        elif envelope.data_type == self._done_id:
            self._take(envelope, None)
        elif envelope.data_type != self._step_id and self._session.source not in self._own:
            self._hear(envelope)

    def _messages(self, order: Order) -> list[Any]:
        self._number += 1
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
            if self._waiting.get(done.service) != done.number:
                return
            if address is not None:
                self._addresses[done.service] = address
                self._own.add((address[0], done.port))
            data = self._pieces.setdefault(done.service, Pieces()).take(done.number, done.part, done.parts, done.frames)
            if data is not None:
                facts = (done.memories, done.pictures, done.sampled, done.ended, done.next)
                self._done[done.service] = Done(done.service, tuple(frames(data)), *facts)
                del self._waiting[done.service]
        except (FrameError, MessageError):
            return  # not from one of ours
