"""The protobuf wire below the message classes: for encodings that libcluon would not write itself.

Reference: Protocol Buffers, "Encoding".
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

VARINT, EIGHT_BYTES, DELIMITED, FOUR_BYTES = 0, 1, 2, 5
MAX_VARINT_BYTES = 10
MAX_NESTING = 32

Bytes = bytes | bytearray | memoryview
Shape = Mapping[int, "Shape"]  # by field numbers; that of a message has its own shape


class WireError(ValueError):
    """Bytes that are not protobuf's encoding of fields."""


class Chunk(NamedTuple):
    """One field on the wire: ``head`` is its key (and length), ``body`` its value."""

    number: int
    wire_type: int
    head: Bytes
    body: Bytes


def chunks(data: Bytes) -> Iterator[Chunk]:
    """The fields of ``data`` in their order, without a copy of a memoryview; raises WireError."""
    position = 0
    while position < len(data):
        start = position
        key, begin = read_varint(data, start)
        number, wire_type = key >> 3, key & 7
        if wire_type == VARINT:
            _, end = read_varint(data, begin)
        elif wire_type == DELIMITED:
            length, begin = read_varint(data, begin)
            end = begin + length
        elif wire_type in (EIGHT_BYTES, FOUR_BYTES):
            end = begin + (8 if wire_type == EIGHT_BYTES else 4)
        else:
            raise WireError(f"wire type {wire_type} at byte {start}")
        if not 0 < number < 2**29 or end > len(data):
            raise WireError(f"field {number} at byte {start} is cut or has no number")
        yield Chunk(number, wire_type, data[start:begin], data[begin:end])
        position = end


def read_varint(data: Bytes, position: int) -> tuple[int, int]:
    """The number at ``position`` and the position after it."""
    value = shift = 0
    for index in range(position, min(position + MAX_VARINT_BYTES, len(data))):
        byte = data[index]
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, index + 1
        shift += 7
    raise WireError(f"the number at byte {position} has no end")


def zigzag(value: int) -> int:
    """A number of 32 bits with a sign as one without."""
    return value << 1 ^ value >> 31


def unzigzag(value: int) -> int:
    return value >> 1 ^ -(value & 1)


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def keep_first(data: Bytes, shape: Shape) -> bytes:
    """``data`` with only the first occurrence of each field, inside of messages too."""
    found: dict[int, bytes] = {}
    for number, wire_type, head, body in chunks(data):
        if number not in found:
            found[number] = bytes(head) + bytes(body)
            if wire_type == DELIMITED and (inner := shape.get(number)):
                kept = keep_first(body, inner)
                found[number] = varint(number << 3 | DELIMITED) + varint(len(kept)) + kept
    return b"".join(found.values())
