"""A service's link to the clock: steps that come once, and answers that are repeated on demand.

It is a socket apart from the bus, between the clock of a lockstep test and one service, that wakes no others. What they
exchange is split into datagrams and reassembled.
"""

import logging
import select
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.address import RECEIVE_BUFFER, Address, group
from dodo_dsl.opendlv.authentication import is_proven, with_proof
from dodo_dsl.opendlv.envelope import HEADER_BYTES, Envelope, FrameError, body_length, decode_frame, encode_frame
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.session import MAX_DATAGRAM_BYTES, MAX_DROPPED, Session

_log = logging.getLogger(__name__)


class ClockChannel:
    """Sends messages in OpenDLV's frames to one address, or to all on the bus, and receives the replies.

    All of them prove that their sender has the key of the test; what does not is not a reply.
    """

    def __init__(self, cid: int, messages: MessageSet, key: bytes = b"") -> None:
        self._group = group(cid)
        self._messages = messages
        self._key = key
        self.foreign = 0
        """How many datagrams came without a proof."""
        self._has_failed = False
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket.bind(("", 0))
        self._socket.setblocking(False)

    def send(self, message: Message, to: Address | None) -> None:
        """Send to an address, or with None to all on the bus; what cannot be sent now is lost, and will be repeated.

        A lasting error is logged once.
        """
        frame = encode_frame(self.envelope(message))
        try:
            self._socket.sendto(frame, to or self._group)
        except BlockingIOError:
            return
        except OSError as error:
            if not self._has_failed:
                self._has_failed = True
                _log.warning("a message to %s:%d cannot be sent: %s", *(to or self._group), error)

    def envelope(self, message: Message) -> Envelope:
        """A message of now, with its proof."""
        now, id_ = time.time_ns() // 1000, self._messages.id(message)
        return Envelope(id_, with_proof(self._key, id_, self._messages.encode(message)), now, 0, now, 0)

    def believes(self, envelope: Envelope) -> bool:
        """Whether a message comes from a sender that has the key."""
        return is_proven(self._key, envelope.data_type, envelope.payload)

    def receive(self) -> tuple[Envelope, Address] | None:
        """The next envelope with its sender's address; None when there is none. Invalid datagrams are skipped."""
        for _ in range(MAX_DROPPED):
            try:
                data, address = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
                envelope = decode_frame(data)
            except FrameError:
                self.foreign += 1
                continue
            except OSError:  # nothing there, or a peer has gone
                return None
            if self.believes(envelope):
                return envelope, address
            self.foreign += 1
        return None

    def fileno(self) -> int:
        """The file descriptor to poll for reading."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


STEP, STEP_DONE = "dodo.Step", "dodo.StepDone"
PART_BYTES = 60_000


class EncodedEnvelope(NamedTuple):
    """An envelope with its frame, so that it is encoded once for all receivers."""

    envelope: Envelope
    frame: bytes


def encode(envelope: Envelope) -> EncodedEnvelope:
    """The envelope, encoded; raises FrameError."""
    return EncodedEnvelope(envelope, encode_frame(envelope))


def split(frames: Iterable[bytes]) -> list[bytes]:
    """Frames one after the other, in parts that datagrams can hold; one empty part for none."""
    data = b"".join(frames)
    return [data[start : start + PART_BYTES] for start in range(0, len(data), PART_BYTES)] or [b""]


def decode(data: bytes) -> Iterator[EncodedEnvelope]:
    """The envelopes in reassembled data; raises FrameError."""
    offset = 0
    while offset < len(data):
        end = offset + HEADER_BYTES + body_length(data[offset : offset + HEADER_BYTES])
        if end > len(data):
            raise FrameError(f"a step's frame has {len(data) - offset} bytes of {end - offset}")
        frame = data[offset:end]
        yield EncodedEnvelope(decode_frame(frame), frame)
        offset = end


@dataclass
class Reassembly:
    """Reassembly of one message as they come, in any order and more than once."""

    number: int = -1
    parts: int = 1
    received: dict[int, bytes] = field(default_factory=dict)

    def take(self, number: int, part: int, parts: int, data: bytes) -> bytes | None:
        """The whole message when this was the last missing part, else None."""
        if number != self.number:
            self.number, self.parts, self.received = number, max(1, parts), {}
        if part in self.received or not 0 <= part < self.parts:
            return None
        self.received[part] = data
        if len(self.received) < self.parts:
            return None
        return b"".join(self.received[i] for i in range(self.parts))


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
    """Receives steps: on the bus at first, and from then on over its own channel.

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
            self._clock = self._clock or address  # a repeated step is not the clock's
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
