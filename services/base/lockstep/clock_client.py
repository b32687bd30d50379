"""A service's link to the clock: steps that come once, and answers that are repeated on demand."""

import select
from collections.abc import Callable
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.bus.envelope import Envelope, FrameError
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.messages.codec import MessageError
from services.base.lockstep.channel import ClockChannel
from services.base.lockstep.datagrams import STEP, STEP_DONE, Reassembly, decode

Reply = list[Message]
SLICE_MS = 100
_BURST = 2
_MEANWHILE = 0.003
"""Seconds that an observer of the bus waits after a message, so that it wakes once for several."""


class Step(NamedTuple):
    """A whole step, as ``dodo.Step`` has it."""

    number: int
    time: int
    show: bool
    messages: list[Envelope]


class ClockClient:
    """Receives steps: on the bus at first, and from then on over a channel of its own.

    A service that does not observe the bus leaves it then, so that messages for others do not wake it.
    """

    is_over = False

    def __init__(self, session: Session, name: str, key: bytes = b"") -> None:
        self._session, self._name = session, name
        self._channel = ClockChannel(session.cid, session.messages, key)
        self._step_id, self._done_id = session.messages.id(STEP), session.messages.id(STEP_DONE)
        self._ignored = {self._step_id, self._done_id, session.messages.id("dodo.TestBegin")}
        self._clock: Address | None = None
        self._has_clock = False
        """Whether the clock knows the channel, so that the bus is not needed."""
        self._number = -1
        self._reassembly = Reassembly()
        self._last: Reply = []
        self._on_the_bus = False
        self._acknowledged = False
        self._poll = select.poll()
        self._poll.register(self._channel, select.POLLIN)
        self._poll.register(session, select.POLLIN)

    def next_step(self, observes: bool, observe: Callable[[Envelope], None]) -> Step | None:
        """The next new step, or None after a while; ``observe`` takes everything that was on the bus before it."""
        received = self._channel.receive()
        if received is not None:
            self._has_clock = True
            if observes:
                self._drain(observe)
            return self._accept(*received)
        if not self._has_clock:
            envelope = self._session.receive(0.0)
            if envelope is not None:
                if envelope.data_type == self._step_id:
                    return self._accept(envelope, self._session.source) if self._channel.believes(envelope) else None
                self._observe(envelope, observe)
                return None
        elif observes and self._drain(observe):
            select.select([self._channel], [], [], _MEANWHILE)
            return None
        elif not observes:
            self._leave_the_bus()
        self._poll.poll(SLICE_MS)
        return None

    def _drain(self, observe: Callable[[Envelope], None]) -> int:
        """Take all that is on the bus; returns how many messages that was."""
        taken = 0
        while (envelope := self._session.receive(0.0)) is not None:
            self._observe(envelope, observe)
            taken += 1
        return taken

    def answer(self, reply: Reply, on_the_bus: bool = False) -> None:
        """Send the answer to the step, and keep it to be repeated."""
        self._last, self._on_the_bus = reply, on_the_bus
        self.repeat()

    def repeat(self) -> None:
        """Send the last answer again."""
        for message in self._rotated():
            if self._on_the_bus:
                self._session.send_envelope(self._channel.envelope(message))
            else:
                self._channel.send(message, self._clock)

    def _rotated(self) -> Reply:
        """The last answer's parts, beginning with others each time, as a receive buffer may hold only a few."""
        parts, self._last = self._last, [*self._last[_BURST:], *self._last[:_BURST]]
        return parts

    def is_acknowledged(self) -> bool:
        """Whether the clock acknowledges the last answer within a while; repeats that on demand."""
        self._poll.poll(SLICE_MS)
        while (received := self._channel.receive()) is not None:
            self._accept(*received)
        return self._acknowledged

    def close(self) -> None:
        """Close the channel."""
        self._channel.close()

    def _observe(self, envelope: Envelope, observe: Callable[[Envelope], None]) -> None:
        if envelope.data_type not in self._ignored:
            observe(envelope)

    def _leave_the_bus(self) -> None:
        if self._session.is_member:
            self._session.deafen()
            self._poll.unregister(self._session)

    def _accept(self, envelope: Envelope, address: Address) -> Step | None:
        """The step that this completes, if it is a new one for this service; an answered one is answered again."""
        try:
            step: Any = self._session.messages.decode(envelope.data_type, envelope.payload)
            if envelope.data_type != self._step_id or step.service != self._name or step.number < self._number:
                return None
            self._clock = self._clock or address  # who repeats a step is not the clock
            if step.number == self._number:
                self._acknowledged = not step.parts
                if step.parts and not step.part:
                    self.repeat()
                return None
            data = self._reassembly.take(step.number, step.part, step.parts, step.frames)
            if data is None:
                return None
            self._number, self._last = step.number, []
            return Step(step.number, step.time, step.show, [encoded.envelope for encoded in decode(data)])
        except (FrameError, MessageError, KeyError):
            return None  # not from this test's clock
