import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import recording as recordings
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.recording import (
    MAX_PLACES,
    Damage,
    DamagePlace,
    Recording,
    RecordingError,
    Scanner,
    read_envelopes,
)
from tests.opendlv import vectors

envelopes = vectors.ENVELOPES | vectors.ENVELOPES.map(lambda envelope: envelope._replace(sample_time=0))
UNUSUAL = [
    b"",  # nothing: all zero
    b"\x30\x05\x08\x02",  # another order
    b"\x08\x02\x08\x04\x12\x01a\x12\x01b\x1a\x04\x08\x02\x08\x04",  # doubled fields
    b"\x08\x82\x00\x12\x03abc",  # a number longer than it needs to be
]
unusual = st.sampled_from(UNUSUAL).map(lambda body: b"\x0d\xa4" + len(body).to_bytes(3, "little") + body)
no_magic = st.binary(max_size=30).map(lambda data: data.replace(b"\x0d", b"\x0c"))


def write(folder: Path, data: bytes) -> Path:
    path = folder / "some.rec"
    path.write_bytes(data)
    return path


def read(path: Path) -> tuple[list[Envelope], Damage]:
    with path.open("rb") as stream:
        scanner = Scanner(stream)
        found = [envelope for batch in scanner.batches() for envelope in batch.envelopes()]
    assert found == list(read_envelopes(path))
    return found, scanner.damage


@pytest.fixture(scope="module", params=[16, recordings.CHUNK_BYTES])
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Read some bytes at a time, which end anywhere in a frame."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recordings, "CHUNK_BYTES", request.param)
        yield tmp_path_factory.mktemp("recordings")


@given(st.lists(envelopes, min_size=1, max_size=60))
@pytest.mark.thorough
def test_stream_and_index_give_what_was_written(folder: Path, written: list[Envelope]) -> None:
    path = write(folder, b"".join(map(encode_frame, written)))
    assert read(path) == (written, Damage())
    with Recording(path) as recording:
        assert len(recording) == len(written) and not recording.damage
        assert list(recording.envelopes()) == written
        assert [f for batch in recording.batches() for f in batch.frames()] == list(map(encode_frame, written))
        assert recording.envelope(len(written) - 1) == written[-1]
        assert [recording.index[c].tolist() for c in ("data_type", "sender_stamp", "sampled")] == [
            [e.data_type for e in written],
            [e.sender_stamp for e in written],
            [e.sample_time for e in written],
        ]
        by_time = sorted(written, key=lambda e: e.sample_time)
        assert list(recording.envelopes(recording.by_time())) == by_time


@given(st.lists(st.tuples(no_magic, envelopes.map(encode_frame) | unusual), min_size=1, max_size=40), no_magic)
@pytest.mark.thorough
def test_garbage_between_frames_is_skipped_and_told(
    folder: Path, parts: list[tuple[bytes, bytes]], rest: bytes
) -> None:
    data, places = b"", []
    for garbage, frame in [*parts, (rest, b"")]:
        places += [(len(data), len(garbage))] if garbage else []
        data += garbage + frame
    path = write(folder, data)
    found, damage = read(path)
    assert len(found) == len(parts)
    assert [(p.offset, p.size) for p in damage.places] == places
    assert {p.reason for p in damage.places} <= {"no frame begins here"}
    with Recording(path) as recording:
        assert list(recording.envelopes()) == found and recording.damage == damage


@given(st.binary(max_size=400) | st.lists(st.sampled_from([b"\x0d\xa4", b"\x00", b"\x08\x02", b"\xff"])).map(b"".join))
@pytest.mark.thorough
def test_any_bytes_are_read_or_skipped_once(folder: Path, data: bytes) -> None:
    path = write(folder, data)
    found, damage = read(path)
    try:
        with Recording(path) as recording:
            assert list(recording.envelopes()) == found
            read_bytes = int(recording.index["size"].sum())
            assert recording.damage == damage
    except RecordingError as error:
        assert not found and str(error).endswith(f"its {len(data)} bytes hold no message")
        read_bytes = 0
    assert read_bytes + damage.size == len(data)


def test_a_frame_that_was_cut_in_the_middle_hides_nothing(tmp_path: Path) -> None:
    """A recorder was killed, and another one went on with the same file."""
    frames = [encode_frame(Envelope(1086, bytes([i]) * 30, 1, 2, i, 0)) for i in range(40)]
    found, damage = read(write(tmp_path, b"".join(frames[:20]) + frames[20][:25] + b"".join(frames[21:])))
    assert [e.sample_time for e in found] == [*range(20), *range(21, 40)]
    assert damage.places == [DamagePlace(20 * len(frames[0]), 25, "a frame that holds no envelope")]
    assert str(damage).startswith("skipped 25 bytes at byte ")


def test_a_header_in_a_payload_is_none(tmp_path: Path) -> None:
    usual = encode_frame(Envelope(1, b"\x0d\xa4\x02\x00\x00\x08\x02", 1, 2, 3, 4))
    other = b"\x0d\xa4\x0b\x00\x00\x30\x01\x12\x07\x0d\xa4\x02\x00\x00\x08\x02"
    for frames in ([usual] * 20, [other] * 20, [usual, other] * 3):
        assert [e.payload[:2] for e in read(write(tmp_path, b"".join(frames)))[0]] == [b"\x0d\xa4"] * len(frames)
    found, damage = read(write(tmp_path, usual + b"?" + usual))
    assert (len(found), damage.size) == (2, 1)


def test_a_false_header_claims_more_than_there_is(tmp_path: Path) -> None:
    frame = encode_frame(Envelope(1, b"x", 1, 2, 3, 4))
    found, damage = read(write(tmp_path, b"\x0d\xa4\xff\xff\xff" + frame * 5))
    assert len(found) == 5
    assert damage.places == [DamagePlace(0, 5, "a frame that is cut short")]


def test_many_places_are_counted_and_few_are_kept(tmp_path: Path) -> None:
    frame = encode_frame(Envelope(1, b"x", 1, 2, 3, 4))
    found, damage = read(write(tmp_path, (b"??" + frame) * (MAX_PLACES + 50)))
    assert len(found) == MAX_PLACES + 50
    assert (damage.count, damage.size, len(damage.places)) == (MAX_PLACES + 50, 2 * (MAX_PLACES + 50), MAX_PLACES)


def test_rows_by_message_sender_and_time(tmp_path: Path) -> None:
    frames = [Envelope(1000 + i % 3, b"", 7, 9, i * 10, i % 2) for i in range(12)]
    with Recording(write(tmp_path, b"".join(map(encode_frame, frames)))) as recording:
        assert recording.rows(messages=[1001]).tolist() == [1, 4, 7, 10]
        assert recording.rows(messages=[1001, 1002], sender_stamps=[0]).tolist() == [2, 4, 8, 10]
        assert recording.rows(start=20, end=40).tolist() == [2, 3]
        assert recording.index["time"][0] == 9  # no sample time: when it was received
        assert list(recording.envelopes(np.array([7, 2, 7]))) == [frames[7], frames[2], frames[7]]
        (batch,) = recording.batches()
        assert list(batch.select(np.array([2, 0])).envelopes()) == [frames[2], frames[0]]


def test_a_file_that_shrinks_is_told(tmp_path: Path) -> None:
    frame = encode_frame(Envelope(1, b"x", 1, 2, 3, 4))
    path = write(tmp_path, frame * 9)
    with Recording(path) as recording:
        os.truncate(path, 50)
        with pytest.raises(RecordingError, match="has become shorter"):
            list(recording.envelopes())


def test_files_that_are_no_recordings(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"some\.rec is not a recording: its 5 bytes hold no message"):
        Recording(write(tmp_path, b"hello"))
    with Recording(write(tmp_path, b"")) as recording:
        assert len(recording) == 0 and list(recording.envelopes()) == []
    with pytest.raises(FileNotFoundError):
        Recording(tmp_path / "nowhere.rec")


LARGE = """
import sys
from pathlib import Path
from dodo_dsl.opendlv.recording import Recording, read_envelopes
path = Path(sys.argv[1])
assert sum(1 for _ in read_envelopes(path)) == 96
with Recording(path) as recording:
    assert sum(len(batch) for batch in recording.batches(recording.by_time())) == 96
print(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    frame = encode_frame(Envelope(1055, bytes(2_000_000), 1, 1, 1, 0))
    path = tmp_path / "large.rec"
    with path.open("wb") as file:
        for _ in range(96):
            file.write(frame)
    output = subprocess.run([sys.executable, "-c", LARGE, str(path)], capture_output=True, text=True, check=True).stdout
    assert int(output) < 130_000, "kilobytes for a file of 192 megabytes"


COUNTS = {
    "track-1-2025-05-08.rec": {(1055, 0): 591},
    "sim-2023-04-27.rec": {
        **{(1001, 0): 935, (1002, 0): 959, (11, 0): 1, (1094, 0): 856, (1094, 1): 856, (1037, 2): 224, (1037, 3): 230},
        **{(1039, 0): 232, (1039, 1): 225, (1039, 2): 224, (1039, 3): 230},
    },
    "cones-2020-05-15.rec": {(1086, 0): 128, (1090, 0): 128, (1144, 0): 1338, (11, 0): 1},
}


@pytest.mark.parametrize("name", COUNTS)
def test_recordings_of_others(name: str, shared_data: Callable[[str], Path]) -> None:
    path = shared_data(name)
    found, damage = read(path)
    assert Counter((e.data_type, e.sender_stamp) for e in found) == COUNTS[name]
    assert not damage and len(found) == sum(COUNTS[name].values())
    assert b"".join(map(encode_frame, found)) == path.read_bytes()
    with Recording(path) as recording:
        assert list(recording.envelopes()) == found
