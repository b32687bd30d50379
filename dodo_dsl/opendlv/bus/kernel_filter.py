"""A filter that lets the kernel drop datagrams with other messages, so that they wake no process.

Linux: Documentation/networking/filter.rst, "classic" BPF. A program sees a datagram from its UDP header on.
"""

import ctypes
import socket
import struct
from collections.abc import Iterable, Iterator

from dodo_dsl.opendlv.bus.address import Address
from dodo_dsl.opendlv.messages.wire import varint, zigzag

_SO_ATTACH_FILTER = 26  # Linux: asm-generic/socket.h
_LOAD = {1: 0x30, 2: 0x28, 4: 0x20}  # BPF_LD | BPF_ABS, a byte, two or four
_SOURCE_PORT, _SOURCE_HOST = 0, 0xFFF0_0000 + 12  # in the UDP header; behind SKF_NET_OFF, in the IP header
_IF_EQUAL, _RETURN = 0x15, 0x06
_ALL, _NOTHING = 0xFFFFFFFF, 0
_UDP_HEADER, _FRAME_HEADER = 8, 5
_TAG = _UDP_HEADER + _FRAME_HEADER
_ID_TAG = 0x08  # the envelope's first field
_INSTRUCTION = struct.Struct("@HBBI")
_MOST = 4096

Instruction = tuple[int, int, int, int]


def attach(
    receiver: socket.socket, ids: Iterable[int], of_others: Iterable[int] = (), than: Iterable[Address] = ()
) -> bool:
    """Passes only messages with these ids, and datagrams that do not begin with an id; False where the kernel cannot.

    Messages with ids ``of_others`` pass unless they come from addresses in ``than``. Dropped datagrams count as lost in
    the kernel's counter of the socket.
    """
    program = [*_program(ids, of_others, than)]
    if len(program) > _MOST:
        return False
    code = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*each) for each in program))
    try:
        receiver.setsockopt(
            socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("@HP", len(program), ctypes.addressof(code))
        )
    except OSError:
        return False
    return True


def _program(ids: Iterable[int], of_others: Iterable[int], than: Iterable[Address]) -> Iterator[Instruction]:
    yield _LOAD[1], 0, 0, _TAG
    yield _IF_EQUAL, 1, 0, _ID_TAG
    yield _RETURN, 0, 0, _ALL
    for id_ in sorted(ids):
        yield from _passing(varint(zigzag(id_)))
    for host, port in sorted(than):
        yield _LOAD[2], 0, 0, _SOURCE_PORT
        yield _IF_EQUAL, 0, 3, port
        yield _LOAD[4], 0, 0, _SOURCE_HOST
        yield _IF_EQUAL, 0, 1, int.from_bytes(socket.inet_aton(host), "big")
        yield _RETURN, 0, 0, _NOTHING
    for id_ in sorted(of_others):
        yield from _passing(varint(zigzag(id_)))
    yield _RETURN, 0, 0, _NOTHING


def _passing(encoded: bytes) -> Iterator[Instruction]:
    """Return here when the bytes behind the tag are these, else go on behind."""
    pieces = [encoded[start : start + 2] for start in range(0, len(encoded), 2)]
    for number, piece in enumerate(pieces):
        yield _LOAD[len(piece)], 0, 0, _TAG + 1 + 2 * number
        yield _IF_EQUAL, 0, 2 * (len(pieces) - number) - 1, int.from_bytes(piece, "big")
    yield _RETURN, 0, 0, _ALL
