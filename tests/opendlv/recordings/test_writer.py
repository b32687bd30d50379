import io
from pathlib import Path

import pytest

from dodo_dsl.opendlv.address import FrameError
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.recording_writer import RecordingWriter

ENVELOPE = Envelope(1086, b"\x0d\x00\x00\x00\x00", 1, 2, 3, 4)


def test_frames_are_there_before_the_end(tmp_path: Path) -> None:
    path = tmp_path / "new.rec"
    with RecordingWriter(path) as writer:
        writer.write(ENVELOPE)
        writer.write_frames(encode_frame(ENVELOPE._replace(sample_time=time)) for time in range(9))
        assert [e.sample_time for e in read_envelopes(path)] == [3, *range(9)]
        assert (writer.frames, writer.size) == (10, path.stat().st_size)


def test_an_envelope_that_fits_in_no_frame_is_not_written(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "new.rec") as writer:
        with pytest.raises(FrameError):
            writer.write(ENVELOPE._replace(payload=bytes(1 << 24)))
        writer.write(ENVELOPE)
    assert list(read_envelopes(tmp_path / "new.rec")) == [ENVELOPE]


class FullDisk(io.FileIO):
    """Takes 70 bytes in all."""

    def write(self, data: object) -> int:
        room = 70 - self.tell()
        if room <= 0:
            raise OSError(28, "No space left on device")
        return super().write(memoryview(data)[:room])  # type: ignore[arg-type]


def test_a_full_disk_leaves_whole_frames(tmp_path: Path) -> None:
    path = tmp_path / "new.rec"
    with RecordingWriter(path) as writer:
        writer._file.close()
        writer._file = FullDisk(path, "wb")
        writer.write(ENVELOPE)
        with pytest.raises(OSError, match="No space left"):
            writer.write(ENVELOPE._replace(payload=bytes(100)))
    assert path.read_bytes() == encode_frame(ENVELOPE)
