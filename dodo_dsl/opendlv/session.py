"""A session on the bus: UDP multicast as libcluon's OD4Session speaks it, without threads.

A filter lets the kernel drop datagrams with other messages, so that they wake no process. Linux:
Documentation/networking/filter.rst, "classic" BPF. A program sees a datagram from its UDP header on.
"""

import contextlib
import ctypes
import errno
import itertools
import math
import select
import socket
import struct
import time
from collections.abc import Iterable, Iterator
from typing import Self

from google.protobuf.message import Message

from dodo_dsl.opendlv.address import RECEIVE_BUFFER, Address, FrameError, group, sender
from dodo_dsl.opendlv.envelope import Envelope, decode_frame, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.wire import varint, zigzag

_SO_ATTACH_FILTER = 26  # Linux: asm-generic/socket.h
_LOAD = {1: 0x30, 2: 0x28}  # BPF_LD | BPF_ABS, a byte or two
_IF_EQUAL, _RETURN = 0x15, 0x06
_ALL, _NOTHING = 0xFFFFFFFF, 0
_TAG = 8 + 5  # behind the headers of UDP and of the frame
_FILTERED_TAG = 0x08  # the envelope's first field
_INSTRUCTION = struct.Struct("@HBBI")
_MOST = 4096

Instruction = tuple[int, int, int, int]


def attach_filter(receiver: socket.socket, ids: Iterable[int]) -> None:
    """Passes only messages with these ids, and datagrams that do not begin with an id, where the kernel can.

    Dropped datagrams count as lost in the kernel's counter of the socket.
    """
    program = [*_program(ids)]
    if len(program) > _MOST:
        return
    code = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*each) for each in program))
    with contextlib.suppress(OSError):
        filter_ = struct.pack("@HP", len(program), ctypes.addressof(code))
        receiver.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, filter_)


def _program(ids: Iterable[int]) -> Iterator[Instruction]:
    yield _LOAD[1], 0, 0, _TAG
    yield _IF_EQUAL, 1, 0, _FILTERED_TAG
    yield _RETURN, 0, 0, _ALL
    for id_ in sorted(ids):
        yield from _passing(varint(zigzag(id_)))
    yield _RETURN, 0, 0, _NOTHING


def _passing(encoded: bytes) -> Iterator[Instruction]:
    """Return here when the bytes behind the tag are these, else go on behind."""
    pieces = [encoded[start : start + 2] for start in range(0, len(encoded), 2)]
    for number, piece in enumerate(pieces):
        yield _LOAD[len(piece)], 0, 0, _TAG + 1 + 2 * number
        yield _IF_EQUAL, 0, 2 * (len(pieces) - number) - 1, int.from_bytes(piece, "big")
    yield _RETURN, 0, 0, _ALL


MAX_DATAGRAM_BYTES = 65_507
CIDS = range(1, 255)
_ROOMY = 4_000_000
"""Bytes of a receive buffer that hold what a fast bus carries while messages gather."""
MAX_DROPPED = 1000  # before a flood of garbage can end a wait
_NO_ROUTE = (errno.ENODEV, errno.ENETUNREACH)
_IP_MULTICAST_ALL = 49  # Linux: linux/in.h
_SO_TIMESTAMPNS = 35  # Linux: asm-generic/socket.h
_SO_RXQ_OVFL = 40
_TIMESPEC = struct.Struct("@qq")
_COUNT = struct.Struct("@I")
_ANCILLARY_BYTES = socket.CMSG_SPACE(_TIMESPEC.size) + socket.CMSG_SPACE(_COUNT.size)


class SessionError(OSError):
    """The bus cannot be joined or does not take a message."""


class Session:
    """One member of the group 225.0.0.<cid>; a context manager.

    Datagrams of the session itself are dropped, as libcluon does. Bytes of others that are not a frame are
    counted in ``garbage``, and in ``lost`` the datagrams for which the receive buffer had no room. Raises SessionError
    for a cid outside 1 to 254 and if there is no route for multicast.
    """

    def __init__(self, cid: int, messages: MessageSet | None = None) -> None:
        if cid not in CIDS:
            raise SessionError(f"a session's cid is 1 to 254, not {cid}")
        self.cid = cid
        self.messages = messages or MessageSet.standard()
        self.garbage = 0
        self.lost = 0
        self.is_member = True
        self._only: frozenset[int] | None = None
        self.address: Address = ("", 0)
        """Host and port from which this session's datagrams come."""
        self.source: Address = ("", 0)
        """Host and port from which the last datagram came."""
        self.was_direct = False
        """Whether the last datagram came to this session's own address, and not to the group."""
        bus = group(cid)
        try:
            self._sender, self.address = sender(bus)
            self._receiver = self._joined(bus)
        except OSError as error:
            hint = " (is there a route to 224.0.0.0/4?)" if error.errno in _NO_ROUTE else ""
            raise SessionError(f"the bus {bus[0]}:{bus[1]} cannot be joined: {error.strerror}{hint}") from None
        self._bus = bus
        self._gathers, self._may_gather = 0.0, False
        self.hears_directly = False
        """Whether it receives what others send to its own address."""
        self._pending: dict[socket.socket, tuple[Envelope, Address]] = {}
        """In the order of arrival across both sockets: what one has while the other may have something older."""
        self._dropped: dict[socket.socket, int] = {}
        self._buffer = bytearray(MAX_DATAGRAM_BYTES + 1)
        self._view = memoryview(self._buffer)
        self._poll = select.poll()
        self._poll.register(self._receiver, select.POLLIN)

    def send(self, message: Message, sample_time: int | None = None, sender_stamp: int = 0) -> bytes:
        """Send a message sampled at ``sample_time`` (microseconds since the epoch; by default: now); returns the frame.

        Raises MessageError, FrameError or SessionError.
        """
        now = time.time_ns() // 1000
        sampled = now if sample_time is None else sample_time
        id_, payload = self.messages.id(message), self.messages.encode(message)
        return self.send_envelope(Envelope(id_, payload, now, 0, sampled, sender_stamp))

    def send_envelope(self, envelope: Envelope) -> bytes:
        """Sends an envelope unchanged and returns its frame; raises FrameError, and SessionError above 65,507 bytes."""
        frame = datagram(envelope)
        self.send_frames((frame,))
        return frame

    def send_frames(self, frames: Iterable[bytes]) -> None:
        """Sends encoded envelopes; raises SessionError."""
        try:
            for frame in frames:
                self._sender.sendto(frame, self._bus)
        except OSError as error:
            raise SessionError(f"the bus does not take a message: {error.strerror}") from None

    def send_directly(self, envelope: Envelope, to: Iterable[Address]) -> bytes:
        """As ``send_envelope``, but to the addresses of sessions alone: other members of the group do not hear it.

        One that cannot be reached misses it.
        """
        frame = datagram(envelope)
        for address in to:
            with contextlib.suppress(OSError):
                self._sender.sendto(frame, address)
        return frame

    def gather(self, seconds: float) -> None:
        """Lets messages gather after some were received, so that this process wakes once for several.

        Not where the kernel grants so small a buffer that it would be full meanwhile.
        """
        room = self._receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        self._gathers = seconds if room >= _ROOMY else 0.0

    def receive(self, timeout: float | None = 0.0) -> Envelope | None:
        """The next envelope of another member, with ``received`` set; None when ``timeout`` seconds are over.

        ``None`` waits without end. A signal whose handler returns does not end the wait.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        for dropped in itertools.count():
            try:
                envelope = self._next()
            except BlockingIOError:
                if not self._wait(deadline):
                    return None
            else:
                if envelope is not None:
                    self._may_gather = True
                    return envelope
            if dropped > MAX_DROPPED and deadline is not None and time.monotonic() > deadline:
                return None
        raise AssertionError

    def fileno(self) -> int:
        """The file descriptor to select on for reading."""
        return self._receiver.fileno()

    def filenos(self) -> list[int]:
        """As ``fileno``, with that of its own address if it ``hears_directly``."""
        return [each.fileno() for each in self._sources()]

    def hear_only(self, ids: Iterable[int]) -> None:
        """Receive messages with ``ids`` from now on; where the kernel can, this process is not woken for others.

        Losses are not counted any more, as the kernel counts the others with them.
        """
        self._only = frozenset(ids)
        attach_filter(self._receiver, self._only)

    def hear_directly(self, hears: bool = True) -> None:
        """Receive also what others send to this session's own ``address``, or no longer."""
        if hears == self.hears_directly:
            return
        self.hears_directly = hears
        if hears:
            _as_receiver(self._sender)
            self._poll.register(self._sender, select.POLLIN)
        else:
            self._poll.unregister(self._sender)
            self._pending.pop(self._sender, None)

    def deafen(self) -> None:
        """Stops receiving, so that messages no longer wake this process; sending goes on."""
        if self.is_member:
            membership = _membership(group(self.cid)[0])
            _set_if_known(self._receiver, socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
            self._receiver.setsockopt(socket.IPPROTO_IP, socket.IP_DROP_MEMBERSHIP, membership)
            self.is_member = False

    @property
    def port(self) -> int:
        """From which this session's datagrams come."""
        return self.address[1]

    def close(self) -> None:
        self._receiver.close()
        self._sender.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _joined(self, bus: Address) -> socket.socket:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            _as_receiver(receiver)
            receiver.bind(bus)
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, _membership(bus[0]))
            receiver.setblocking(False)
        except OSError:
            receiver.close()
            self._sender.close()
            raise
        return receiver

    def _next(self) -> Envelope | None:
        if not self.hears_directly and not self._pending:
            self.was_direct = False
            return self._take(self._receiver)
        for source in self._sources():
            if source not in self._pending:
                with contextlib.suppress(BlockingIOError):
                    envelope = self._take(source)
                    if envelope is None:
                        return None  # what comes behind it may be older than what the other socket has
                    self._pending[source] = envelope, self.source
        if not self._pending:
            raise BlockingIOError
        first = min(self._pending, key=lambda source: self._pending[source][0].received)
        envelope, self.source = self._pending.pop(first)
        self.was_direct = first is self._sender
        return envelope

    def _sources(self) -> tuple[socket.socket, ...]:
        return (self._receiver, self._sender) if self.hears_directly else (self._receiver,)

    def _take(self, receiver: socket.socket) -> Envelope | None:
        size, ancillary, _, address = receiver.recvmsg_into([self._buffer], _ANCILLARY_BYTES, socket.MSG_DONTWAIT)
        if len(ancillary) > 1 and self._only is None:
            self._dropped[receiver] = _lost(ancillary)
            self.lost = sum(self._dropped.values())
        if address == self.address:
            return None
        self.source = address
        try:
            envelope = decode_frame(bytes(self._view[:size]), _received(ancillary))
        except FrameError:
            self.garbage += 1
            return None
        return envelope if self._only is None or envelope.data_type in self._only else None

    def _wait(self, deadline: float | None) -> bool:
        left = math.inf if deadline is None else deadline - time.monotonic()
        if left > 0 and self._may_gather and self._gathers:
            self._may_gather = False
            time.sleep(min(self._gathers, left))
            return True
        return left > 0 and bool(self._poll.poll(None if deadline is None else left * 1000))


def datagram(envelope: Envelope) -> bytes:
    """The frame of an envelope; raises FrameError, and SessionError above 65,507 bytes."""
    frame = encode_frame(envelope)
    if len(frame) > MAX_DATAGRAM_BYTES:
        what = f"message {envelope.data_type} needs {len(frame)} bytes of {MAX_DATAGRAM_BYTES} in a datagram"
        raise SessionError(what)
    return frame


def _received(ancillary: list[tuple[int, int, bytes]]) -> int:
    """When the kernel took the datagram, else now; microseconds since the epoch."""
    for _, kind, data in ancillary:
        if kind == _SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            return int(seconds) * 1_000_000 + int(nanoseconds) // 1000
    return time.time_ns() // 1000


def _lost(ancillary: list[tuple[int, int, bytes]]) -> int:
    return max((int(_COUNT.unpack(data)[0]) for _, kind, data in ancillary if kind == _SO_RXQ_OVFL), default=0)


def _as_receiver(receiver: socket.socket) -> None:
    """Room for many datagrams, each with its time, and with a count of those that were lost."""
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    _set_if_known(receiver, socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    _set_if_known(receiver, socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)


def _set_if_known(of: socket.socket, level: int, option: int, value: int) -> None:
    """Sets an option that a session can do without: QEMU's emulation of other processors lacks some."""
    try:
        of.setsockopt(level, option, value)
    except OSError as error:
        if error.errno != errno.ENOPROTOOPT:
            raise


def _membership(host: str) -> bytes:
    return socket.inet_aton(host) + socket.inet_aton("0.0.0.0")  # noqa: S104
