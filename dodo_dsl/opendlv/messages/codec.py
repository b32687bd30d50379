"""Payloads of messages as libcluon writes and reads them."""

from typing import Any

from google.protobuf.message import DecodeError, Message

from dodo_dsl.opendlv.messages import wire
from dodo_dsl.opendlv.messages.protobuf_classes import Layout
from dodo_dsl.opendlv.odvd.field_types import INTEGER_BITS, integer_range


class MessageError(ValueError):
    """A message that cannot be encoded, or a payload that cannot be decoded."""


def encode(layout: Layout, message: Message) -> bytes:
    """Every field in order, zeros and defaults too; raises MessageError for a number too large."""
    if layout.narrow or layout.inner:
        _check_ranges(message, layout)
    data: bytes = message.SerializeToString()
    if len(data) != layout.fixed_size:
        data = layout.type.FromString(layout.filled + data).SerializeToString()
    return wire.in_order(data, layout.shape) if layout.reorder else data


def decode(layout: Layout, payload: bytes) -> Any:
    """The message in a payload; raises MessageError.

    protobuf lets the last of equal fields count and merges messages: a changed size reveals that.
    """
    try:
        message = layout.type.FromString(payload)
        message.DiscardUnknownFields()
        if message.ByteSize() != len(payload):
            message = layout.type.FromString(wire.keep_first(payload, layout.shape))
            message.DiscardUnknownFields()
        _check_decoded(message, layout)
    except (DecodeError, wire.WireError) as error:
        raise MessageError(f"the payload is not a valid {layout.definition.name}: {error}") from None
    return message


def _check_ranges(message: Message, layout: Layout) -> None:
    for field, type_ in layout.narrow:
        if getattr(message, field) not in integer_range(type_):
            raise MessageError(f"{layout.definition.name}.{field} is {type_} and cannot be {getattr(message, field)}")
    for field, inner in layout.inner.items():
        _check_ranges(getattr(message, field), inner)


def _check_decoded(message: Message, layout: Layout) -> None:
    """Strings must be UTF-8 (others are bytes in protobuf); large integers lose their upper bits as in C++."""
    for field in layout.texts:
        if not isinstance(getattr(message, field), str):
            raise wire.WireError(f"'{field}' is not UTF-8 text")
    for field, type_ in layout.narrow:
        value = getattr(message, field)
        if value not in integer_range(type_):
            setattr(message, field, _truncated(value, type_))
    for field, inner in layout.inner.items():
        if message.HasField(field):
            _check_decoded(getattr(message, field), inner)


def _truncated(value: int, type_: str) -> int:
    mask: int = 2 ** INTEGER_BITS[type_] - 1
    if not type_.startswith("int"):
        return value & mask
    zigzag = (value << 1 ^ value >> 31) & mask
    return zigzag >> 1 ^ -(zigzag & 1)
