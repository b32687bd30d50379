"""Many numbers at once are the same as one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import message_columns, wire

PADDING = bytes(message_columns.WORD_BYTES)


@given(st.lists(st.integers(0, 2**56 - 1), min_size=1, max_size=40))
def test_numbers_of_up_to_8_bytes(values: list[int]) -> None:
    encoded = [wire.varint(value) for value in values]
    lengths = np.array([len(each) for each in encoded])
    at = np.cumsum(lengths) - lengths
    found, size = message_columns.read_varints(message_columns.fixed_words(b"".join(encoded) + PADDING), at)
    assert found.tolist() == values
    assert size.tolist() == lengths.tolist()


@given(st.binary(min_size=1, max_size=60))
def test_any_bytes_are_read_as_the_codec_reads_them(data: bytes) -> None:
    found, size = message_columns.read_varints(message_columns.fixed_words(data + PADDING), np.arange(len(data)))
    for at, (value, length) in enumerate(zip(found.tolist(), size.tolist(), strict=True)):
        if 0 < length <= len(data) - at:
            assert wire.read_varint(data, at) == (value, at + length)
        elif length == 0:
            assert all(byte >= 0x80 for byte in data[at : at + message_columns.WORD_BYTES])


@given(st.lists(st.integers(-(2**55), 2**55 - 1), max_size=20))
@pytest.mark.thorough
def test_signed_numbers(values: list[int]) -> None:
    zigzag = np.array([value << 1 if value >= 0 else ~(value << 1) for value in values], np.int64)
    assert message_columns.signed_varints(zigzag).tolist() == values


def test_too_few_bytes_have_no_words() -> None:
    assert len(message_columns.fixed_words(b"1234567")) == 0
    assert message_columns.fixed_words(b"\x01\0\0\0\0\0\0\0\x02").tolist() == [1, 2 << 56]
