from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.address import FrameError, body_length
from dodo_dsl.opendlv.envelope import Envelope, decode_frame, encode_frame
from tests.opendlv import vectors


def framed(body: bytes) -> bytes:
    return b"\x0d\xa4" + len(body).to_bytes(3, "little") + body


def test_frames_of_libcluon(shared_data: Callable[[str], Path]) -> None:
    for vector in vectors.read(shared_data("od4-vectors.txt")):
        envelope = decode_frame(vector.frame)
        assert envelope == Envelope(vector.id, vector.payload, vector.time, 0, vector.time, vector.sender_stamp)
        assert encode_frame(envelope) == vector.frame


@given(vectors.ENVELOPES)
def test_round_trip(envelope: Envelope) -> None:
    assert decode_frame(encode_frame(envelope)) == envelope


def test_times_before_1970_are_negative_in_both_parts() -> None:
    frame = encode_frame(Envelope(1, b"", -1_000_001, 0, -1, 0))
    assert frame.hex() == "0da4180000" + "08021200" + "1a0408011001" + "220408001000" + "2a0408001001" + "3000"


def test_absent_fields_any_order_and_the_first_of_equal_ones() -> None:
    assert decode_frame(framed(b"")) == Envelope(0, b"", 0, 0, 0, 0)
    assert decode_frame(framed(b"\x30\x05\x08\x02")) == Envelope(1, b"", 0, 0, 0, 5)
    doubled = b"\x08\x02\x08\x04\x12\x01a\x12\x01b\x1a\x04\x08\x02\x08\x04\x1a\x02\x10\x06\x30\x85\x00\x30\x06"
    assert decode_frame(framed(doubled)) == Envelope(1, b"a", 1_000_000, 0, 0, 5)


def test_bytes_after_the_frame_are_ignored() -> None:
    assert decode_frame(framed(b"\x08\x02") + b"more").data_type == 1


@given(st.binary() | st.binary().map(framed))
def test_any_bytes_give_an_envelope_or_an_error(data: bytes) -> None:
    try:
        envelope = decode_frame(data)
    except FrameError:
        return
    assert len(data) >= 5 + body_length(data)
    assert decode_frame(encode_frame(envelope)) == envelope


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (b"", "header"),
        (b"\x0d\xa4\x00\x00", "header"),
        (b"\x0d\xa5\x00\x00\x00", "header"),
        (framed(b"\x08\x02")[:-1], "6 bytes of 7"),
        (framed(b"\xff\xff\xff"), "holds no envelope"),
        (framed(b"\x0b\x08"), "holds no envelope"),
    ],
)
def test_bytes_that_are_no_frame(frame: bytes, text: str) -> None:
    with pytest.raises(FrameError, match=text):
        decode_frame(frame)


@pytest.mark.parametrize(
    "envelope",
    [
        Envelope(2**31, b"", 0, 0, 0, 0),
        Envelope(1, b"", 2**31 * 1_000_000, 0, 0, 0),
        Envelope(1, b"", 0, 0, 0, -1),
        Envelope(1, bytes(2**24), 0, 0, 0, 0),
    ],
)
def test_envelopes_that_do_not_fit(envelope: Envelope) -> None:
    with pytest.raises(FrameError):
        encode_frame(envelope)
