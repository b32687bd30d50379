"""The protobuf wire below the message classes: for encodings that libcluon would not write itself.

Reference: Protocol Buffers, "Encoding".
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

VARINT, EIGHT_BYTES, DELIMITED, FOUR_BYTES = 0, 1, 2, 5
MAX_VARINT_BYTES = 10
MAX_NESTING = 32

Shape = Mapping[int, "Shape"]  # field numbers in order of declaration; that of a message has its own shape


class WireError(ValueError):
    """Bytes that are not protobuf's encoding of fields."""


@dataclass(frozen=True)
class Chunk:
    """One field on the wire: ``head`` is its key (and length), ``body`` its value."""

    number: int
    wire_type: int
    head: bytes
    body: bytes


def chunks(data: bytes) -> Iterator[Chunk]:
    """The fields of ``data`` in their order; raises WireError."""
    position = 0
    while position < len(data):
        start = position
        key, position = read_varint(data, position)
        number, wire_type = key >> 3, key & 7
        if wire_type == VARINT:
            value_start = position
            _, end = read_varint(data, position)
        elif wire_type == DELIMITED:
            length, value_start = read_varint(data, position)
            end = value_start + length
        elif wire_type in (EIGHT_BYTES, FOUR_BYTES):
            value_start = position
            end = position + (8 if wire_type == EIGHT_BYTES else 4)
        else:
            raise WireError(f"wire type {wire_type} at byte {start}")
        if not 0 < number < 2**29 or end > len(data):
            raise WireError(f"field {number} at byte {start} is cut or has no number")
        yield Chunk(number, wire_type, data[start:value_start], data[value_start:end])
        position = end


def read_varint(data: bytes | bytearray | memoryview, position: int) -> tuple[int, int]:
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
    """The number with a sign."""
    return value >> 1 ^ -(value & 1)


def varint(value: int) -> bytes:
    """Encode a number that is not negative."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def keep_first(data: bytes, shape: Shape) -> bytes:
    """``data`` with only the first occurrence of each field, inside of messages too."""
    found: dict[int, bytes] = {}
    for chunk in chunks(data):
        if chunk.number not in found:
            found[chunk.number] = _rewritten(chunk, shape, keep_first)
    return b"".join(found.values())


def in_order(data: bytes, shape: Shape) -> bytes:
    """``data``, which has every field once, with its fields in the shape's order."""
    found = {chunk.number: _rewritten(chunk, shape, in_order) for chunk in chunks(data)}
    return b"".join(found[number] for number in shape)


def _rewritten(chunk: Chunk, shape: Shape, rewrite: Callable[[bytes, Shape], bytes]) -> bytes:
    inner = shape.get(chunk.number)
    if chunk.wire_type != DELIMITED or not inner:
        return chunk.head + chunk.body
    body = rewrite(chunk.body, inner)
    return varint(chunk.number << 3 | DELIMITED) + varint(len(body)) + body
