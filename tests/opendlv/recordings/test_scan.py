"""Frames of a stream in batches, whatever lies between them and however reading cuts them."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import recording
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.recording import Scanner

ENVELOPES = st.builds(
    Envelope,
    st.integers(1, 2**31 - 1),
    st.binary(max_size=20),
    st.integers(0, 2**50),
    st.integers(0, 2**50),
    st.integers(0, 2**50),
    st.integers(0, 2**32 - 1),
)
GARBAGE = st.binary(max_size=9).filter(lambda data: b"\x0d" not in data and b"\xa4" not in data)


@pytest.fixture(scope="module", autouse=True)
def few_bytes_at_a_time() -> object:
    """Chunks of the reader that end anywhere in a frame."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "CHUNK_BYTES", 16)
        yield


@given(st.lists(st.tuples(GARBAGE, ENVELOPES), max_size=9), GARBAGE)
@pytest.mark.thorough
def test_frames_are_found_between_garbage(pieces: list[tuple[bytes, Envelope]], behind: bytes) -> None:
    data = b"".join(garbage + encode_frame(envelope) for garbage, envelope in pieces) + behind
    scanner = Scanner(io.BytesIO(data))
    batches = list(scanner.batches())
    assert [e for batch in batches for e in batch.envelopes()] == [envelope for _, envelope in pieces]
    assert [f for batch in batches for f in batch.frames()] == [encode_frame(envelope) for _, envelope in pieces]
    assert scanner.damage.size == len(behind) + sum(len(garbage) for garbage, _ in pieces)
    assert scanner.damage.count == sum(bool(garbage) for garbage, _ in pieces) + bool(behind)
    assert scanner.position == len(data)


@pytest.mark.parametrize("rest", range(1, 12))
def test_a_frame_that_is_cut_short_is_damage(rest: int) -> None:
    frame = encode_frame(Envelope(1086, b"\x0d\0\0\0\0", 1, 2, 3, 4))
    scanner = Scanner(io.BytesIO(frame + frame[:rest]))
    assert sum(map(len, scanner.batches())) == 1
    assert str(scanner.damage).startswith(f"skipped {rest} byte")


def test_rows_are_selected_in_any_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "CHUNK_BYTES", 1 << 16)
    envelopes = [Envelope(7, bytes([number]), 1, 2, number, 4) for number in range(3)]
    (batch,) = Scanner(io.BytesIO(b"".join(map(encode_frame, envelopes)))).batches()
    assert [e.sample_time for e in batch.select(np.array([2, 0])).envelopes()] == [2, 0]
    assert batch.times[2].tolist() == [0, 1, 2]
