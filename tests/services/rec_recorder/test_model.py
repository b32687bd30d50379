import resource
import signal
from contextlib import closing
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from services.rec_recorder.model import RecordingFile, RecordingFileError


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecordingFileError, match=r"drive\.rec cannot be written: No such file or directory"):
        RecordingFile(tmp_path / "nowhere" / "drive.rec")


def envelope(number: int) -> Envelope:
    return Envelope(1090, bytes(100), number, number, number, 0)


def test_it_stops_at_its_largest_size(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "drive.rec"
    with closing(RecordingFile(path, max_size=300)) as recording:
        for number in range(5):
            recording.write(envelope(number))
    assert len(list(read_envelopes(path))) == 2
    assert path.stat().st_size <= 300
    assert [r.getMessage() for r in caplog.records] == [
        "a message was not recorded: the recording has its largest size, 300 bytes",
        "3 messages were not recorded",
    ]


def test_commands_stop_it_and_let_it_go_on(tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    with closing(RecordingFile(path)) as recording:
        for number, command in enumerate((1, 2, 7, 1, 1, 2)):
            recording.write(envelope(number))
            recording.command(command)
        recording.write(envelope(9))
    assert [e.sent for e in read_envelopes(path)] == [0, 1, 4, 5]


def test_a_full_disk_ends_it_with_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with closing(RecordingFile(path)) as recording, pytest.raises(RecordingFileError) as caught:
            for number in range(50):
                recording.write(envelope(number))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    count = len(list(read_envelopes(path)))
    assert 5 < count < 10
    assert str(caught.value) == f"{path} ends after {count} messages: File too large"
