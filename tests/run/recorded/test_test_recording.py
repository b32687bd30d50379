"""What a recording says of its test, and which ones cannot be judged."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.recordings.recording import RecordingError
from dodo_dsl.run.recorded.test_recording import NoTestRecording, inspect
from tests.run.recorded.made import EPOCH, begin, message, step, write

PEDAL = "opendlv.proxy.PedalPositionRequest"
WALL = 1_790_000_000_000_000


def test_in_lockstep_it_lasts_to_its_last_step(tmp_path: Path) -> None:
    path = write(tmp_path / "a.rec", step(1, -1), step(2, 0), begin(), step(3, 2_500_000), message(PEDAL, EPOCH))
    found = inspect(path)
    assert (found.path, found.clock, found.duration_s) == (path, "lockstep", 2.5)


def test_in_real_time_it_lasts_until_recording_ended(tmp_path: Path) -> None:
    drive = (begin(WALL), message(PEDAL, 3, WALL + 1_000_000))
    assert inspect(write(tmp_path / "killed.rec", *drive)).duration_s == 1.0
    found = inspect(write(tmp_path / "a.rec", *drive, message("dodo.RecordingEnd", WALL + 1_750_000)))
    assert (found.clock, found.duration_s) == ("realtime", 1.75)


def test_marks_that_the_application_sent_do_not_count(tmp_path: Path) -> None:
    forged = (step(9, 9_000_000)._replace(received=WALL), message("dodo.RecordingEnd", WALL + 9_000_000, WALL))
    assert inspect(write(tmp_path / "a.rec", step(1, 0), begin(), step(2, 1_000_000), *forged)).duration_s == 1.0
    found = inspect(write(tmp_path / "b.rec", begin(WALL), *forged))
    assert (found.clock, found.duration_s) == ("realtime", 0.0)


def test_recordings_of_no_test_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        NoTestRecording, match=r"a\.rec: has no dodo\.TestBegin \(2900\), .* expected the recording of a"
    ):
        inspect(write(tmp_path / "a.rec", message(PEDAL, 3, WALL)))
    with pytest.raises(NoTestRecording, match=r"has no dodo\.RecordedStep \(2905\), .* run the test again"):
        inspect(write(tmp_path / "old.rec", begin(), message(PEDAL, 3, WALL)))
    (tmp_path / "text.rec").write_text("not a recording at all")
    with pytest.raises(RecordingError, match="is not a recording"):
        inspect(tmp_path / "text.rec")
