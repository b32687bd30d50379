import resource
import signal
from contextlib import closing
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from services.rec_recorder.model import RecordingFile, RecordingFileError


def envelope(number: int) -> Envelope:
    return Envelope(1090, bytes(100), number, number, number, 0)


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
