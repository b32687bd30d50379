"""Fields on protobuf's wire: split and made unique without their message class."""

import pytest
from google.protobuf.internal import encoder
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import wire
from dodo_dsl.opendlv.wire import DELIMITED, EIGHT_BYTES, FOUR_BYTES, VARINT

NUMBERS = st.integers(0, 2**64 - 1)


def field(number: int, wire_type: int, body: bytes) -> bytes:
    length = wire.varint(len(body)) if wire_type == DELIMITED else b""
    return wire.varint(number << 3 | wire_type) + length + body


FIELDS = st.tuples(st.integers(1, 2**29 - 1), st.sampled_from((VARINT, EIGHT_BYTES, DELIMITED, FOUR_BYTES))).flatmap(
    lambda key: st.tuples(
        st.just(key[0]),
        st.just(key[1]),
        {
            VARINT: NUMBERS.map(wire.varint),
            EIGHT_BYTES: st.binary(min_size=8, max_size=8),
            FOUR_BYTES: st.binary(min_size=4, max_size=4),
            DELIMITED: st.binary(max_size=300),
        }[key[1]],
    )
)


@given(NUMBERS, st.binary(max_size=9), st.binary(max_size=9))
def test_numbers_are_those_of_protobuf(value: int, before: bytes, behind: bytes) -> None:
    written: list[bytes] = []
    encoder._VarintEncoder()(written.append, value, False)
    assert wire.varint(value) == b"".join(written)
    assert wire.read_varint(before + wire.varint(value) + behind, len(before)) == (
        value,
        len(before) + len(wire.varint(value)),
    )


@given(st.lists(FIELDS, max_size=9))
@pytest.mark.thorough
def test_fields_are_split_where_they_begin(fields: list[tuple[int, int, bytes]]) -> None:
    data = b"".join(field(*each) for each in fields)
    found = list(wire.chunks(data))
    assert [(chunk.number, chunk.wire_type, chunk.body) for chunk in found] == fields
    assert b"".join(chunk.head + chunk.body for chunk in found) == data


@given(st.binary(max_size=60))
def test_any_bytes_are_fields_or_an_error(data: bytes) -> None:
    try:
        found = list(wire.chunks(data))
    except wire.WireError:
        return
    assert b"".join(chunk.head + chunk.body for chunk in found) == data


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
