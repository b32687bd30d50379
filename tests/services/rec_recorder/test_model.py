from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from services.rec_recorder.model import Recording, RecordingError

times = st.integers(0, 2**31 * 1_000_000 - 1)
envelopes = st.builds(Envelope, st.integers(1, 5000), st.binary(max_size=300), times, times, times, st.integers(0, 9))


@given(st.lists(envelopes, max_size=20))
def test_what_is_written_is_read_again(tmp_path_factory: pytest.TempPathFactory, written: list[Envelope]) -> None:
    path = tmp_path_factory.mktemp("rec") / "drive.rec"
    with Recording(path) as recording:
        for envelope in written:
            recording.write(envelope)
        assert list(read_envelopes(path)) == written  # before it is closed: a killed recorder leaves this
    assert recording.frames == len(written)


def test_a_file_that_is_there_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    path.write_bytes(b"dear")
    with pytest.raises(RecordingError) as caught:
        Recording(path)
    assert str(caught.value) == f"{path} is there already and is not overwritten"
    assert path.read_bytes() == b"dear"


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"drive\.rec cannot be written: No such file or directory"):
        Recording(tmp_path / "nowhere" / "drive.rec")
