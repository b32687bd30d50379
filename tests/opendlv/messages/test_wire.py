"""Fields on protobuf's wire: split and made unique without their message class."""

import pytest

from dodo_dsl.opendlv import wire
from dodo_dsl.opendlv.wire import DELIMITED, VARINT


def field(number: int, wire_type: int, body: bytes) -> bytes:
    length = wire.varint(len(body)) if wire_type == DELIMITED else b""
    return wire.varint(number << 3 | wire_type) + length + body


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"\x0b", "wire type 3 at byte 0"),
        (b"\x08\x01\x0d\x00", "field 1 at byte 2 is cut or has no number"),
        (b"\x0a\x05abcd", "field 1 at byte 0 is cut"),
        (b"\x00\x00", "field 0 at byte 0 is cut or has no number"),
        (b"\x08" + b"\xff" * 10, "the number at byte 1 has no end"),
        (b"\x80", "the number at byte 0 has no end"),
    ],
)
def test_what_is_not_an_encoding_is_an_error_with_its_place(data: bytes, problem: str) -> None:
    with pytest.raises(wire.WireError, match=problem):
        list(wire.chunks(data))


def test_the_first_of_equal_fields_counts_inside_of_messages_too() -> None:
    inner = field(1, VARINT, b"\x01") + field(1, VARINT, b"\x02")
    data = field(2, DELIMITED, inner) + field(3, VARINT, b"\x05") + field(2, DELIMITED, b"")
    once = field(2, DELIMITED, field(1, VARINT, b"\x01")) + field(3, VARINT, b"\x05")
    assert wire.keep_first(data, {2: {1: {}}, 3: {}}) == once
    assert wire.keep_first(data, {2: {}, 3: {}}) == field(2, DELIMITED, inner) + field(3, VARINT, b"\x05")
