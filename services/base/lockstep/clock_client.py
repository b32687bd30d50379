"""A service's side of the talk with the clock: orders that come once, and answers that are repeated on demand."""

import select
from collections.abc import Callable
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.codec import MessageError
from services.base.lockstep.channel import Channel
from services.base.lockstep.datagrams import STEP, STEP_DONE, Pieces, Said, frames

Reply = list[Message]
SLICE_MS = 100
_BURST = 2
_MEANWHILE = 0.003
"""For so many seconds after a message one who looks at the bus lets others come, and is woken once for them all."""


class Step(NamedTuple):
    """A whole step, as ``dodo.Step`` has it."""

    number: int
    time: int
    show: bool
    heard: list[Said]


class Ear:
    """Hears the clock: on the bus at first, and from then on over a channel of its own.

    A service that does not look at the bus leaves it then, so that it is not woken for what does not concern it.
    """

    def __init__(self, session: Session, name: str) -> None:
        self._session, self._name = session, name
        self._channel = Channel(session.cid, session.messages)
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._not_heard = {self._step_id, self._done_id, session.messages.id("dodo.TestBegin")}
        self._clock: Address | None = None
        self._is_met = False
        """Whether the clock knows the channel, so that there is no need of the bus."""
        self._number = -1
        self._pieces = Pieces()
        self._last: Reply = []
        self._on_the_bus = False
        self._acknowledged = False
        self._poll = select.poll()
        self._poll.register(self._channel, select.POLLIN)
        self._poll.register(session, select.POLLIN)

    def listen(self, observes: bool, overhear: Callable[[Envelope], None]) -> Step | None:
        """The next new step, or None when a while has passed; everything that was on the bus before it is overheard."""
        came = self._channel.receive()
        if came is not None:
            self._is_met = True
            if observes:
                self._drain(overhear)
            return self._taken(*came)
        if not self._is_met:
            envelope = self._session.receive(0.0)
            if envelope is not None:
                if envelope.data_type == self._step_id:
                    return self._taken(envelope, self._session.source)
                self._overheard(envelope, overhear)
                return None
        elif observes and self._drain(overhear):
            select.select([self._channel], [], [], _MEANWHILE)
            return None
        elif not observes:
            self._leave_the_bus()
        self._poll.poll(SLICE_MS)
        return None

    def _drain(self, overhear: Callable[[Envelope], None]) -> int:
        """Take all that is on the bus; says how much that was."""
        taken = 0
        while (envelope := self._session.receive(0.0)) is not None:
            self._overheard(envelope, overhear)
            taken += 1
        return taken

    def answer(self, reply: Reply, on_the_bus: bool = False) -> None:
        """Send the answer to the step, and keep it to be repeated."""
        self._last, self._on_the_bus = reply, on_the_bus
        self.repeat()

    def repeat(self) -> None:
        """Send the last answer again."""
        for message in self._turned():
            if self._on_the_bus:
                self._session.send(message)
            else:
                self._channel.send(message, self._clock)

    def _turned(self) -> Reply:
        """The last answer's pieces, beginning with others each time, as a receive buffer may hold but a few."""
        pieces, self._last = self._last, [*self._last[_BURST:], *self._last[:_BURST]]
        return pieces

    def is_acknowledged(self) -> bool:
        """Whether the clock says within a while that it has the last answer; repeats that where it asks."""
        self._poll.poll(SLICE_MS)
        while (came := self._channel.receive()) is not None:
            self._taken(*came)
        return self._acknowledged

    def close(self) -> None:
        """Let go of the channel."""
        self._channel.close()

    def _overheard(self, envelope: Envelope, overhear: Callable[[Envelope], None]) -> None:
        if envelope.data_type not in self._not_heard:
            overhear(envelope)

    def _leave_the_bus(self) -> None:
        if self._session.is_member:
            self._session.deafen()
            self._poll.unregister(self._session)

    def _taken(self, envelope: Envelope, address: Address) -> Step | None:
        """The step when this is the rest of a new one for this service; one that was answered is answered again."""
        try:
            step: Any = self._session.messages.decode(envelope.data_type, envelope.payload)
            if envelope.data_type != self._step_id or step.service != self._name or step.number < self._number:
                return None
            self._clock = address
            if step.number == self._number:
                self._acknowledged = not step.parts
                if step.parts and not step.part:
                    self.repeat()
                return None
            data = self._pieces.take(step.number, step.part, step.parts, step.frames)
            if data is None:
                return None
            self._number, self._last = step.number, []
            return Step(step.number, step.time, step.show, list(frames(data)))
        except (FrameError, MessageError, KeyError):
            return None  # not from our clock
