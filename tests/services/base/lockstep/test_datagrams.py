"""What clock and services tell each other survives being cut, doubled and shuffled."""

import contextlib
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope, FrameError
from services.base.clock_link import PART_BYTES, Reassembly, decode, encode, split

TIMES = st.integers(0, 2**31 * 1_000_000 - 1)
ENVELOPES = st.builds(
    Envelope, st.integers(1, 9999), st.binary(max_size=50_000), TIMES, TIMES, TIMES, st.integers(0, 2**32 - 1)
)


@given(st.lists(ENVELOPES, max_size=6), st.integers(0, 2**32), st.integers(1, 5))
def test_pieces_in_any_order_and_more_than_once(envelopes: list[Envelope], seed: int, number: int) -> None:
    pieces = split(encode(envelope).frame for envelope in envelopes)
    assert all(len(piece) <= PART_BYTES for piece in pieces)
    sent = list(enumerate(pieces)) * 2
    random.Random(seed).shuffle(sent)
    collected = Reassembly()
    collected.take(number - 1, 0, 2, b"of an older step")
    whole = [data for part, piece in sent if (data := collected.take(number, part, len(pieces), piece)) is not None]
    assert len(whole) == 1
    assert [encoded.envelope for encoded in decode(whole[0])] == envelopes


def test_a_frame_that_is_cut_off_is_refused() -> None:
    data = encode(Envelope(1090, b"12345", 0, 0, 0, 0)).frame
    with pytest.raises(FrameError, match=r"a step's frame has \d+ bytes of \d+"):
        list(decode(data + data[:-3]))


@given(st.binary(max_size=200))
def test_anything_else_is_refused(data: bytes) -> None:
    with contextlib.suppress(FrameError):
        assert sum(len(encoded.frame) for encoded in decode(data)) == len(data)


def test_a_part_beyond_the_last_is_left() -> None:
    pieces = Reassembly()
    assert pieces.take(1, 0, 2, b"a") is None
    assert pieces.take(1, 2, 2, b"c") is None
    assert pieces.take(1, 1, 2, b"b") == b"ab"


def test_parts_that_no_message_has_are_not_taken() -> None:
    pieces = Reassembly()
    assert [pieces.take(1, part, 2, b"x") for part in (-1, 2, 0)] == [None] * 3
    assert pieces.take(1, 1, 2, b"y") == b"xy"
