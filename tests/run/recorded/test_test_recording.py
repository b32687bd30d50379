"""What a recording says of its test and its application, and which ones cannot be judged."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import RecordingError
from dodo_dsl.run.test_recording import inspect
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
        RecordingError, match=r"a\.rec: has no dodo\.TestBegin \(2900\), .* expected the recording of a"
    ):
        inspect(write(tmp_path / "a.rec", message(PEDAL, 3, WALL)))
    with pytest.raises(RecordingError, match=r"has no dodo\.RecordedStep \(2905\), .* run the test again"):
        inspect(write(tmp_path / "old.rec", begin(), message(PEDAL, 3, WALL)))
    (tmp_path / "text.rec").write_text("not a recording at all")
    with pytest.raises(RecordingError, match="is not a recording"):
        inspect(tmp_path / "text.rec")


LOCKSTEP = [
    step(1, 0),
    begin(),
    *(
        each
        for number in range(2, 40)
        for each in (message(PEDAL, EPOCH + number * 10_000), step(number, number * 10_000))
    ),
]
REALTIME = [
    begin(EPOCH),
    *(message(PEDAL, EPOCH + number * 10_000, EPOCH + number * 10_000) for number in range(1, 40)),
]
ZERO = {"sent": 0, "received": 0, "sample_time": 0}
LATER = 400 * 86_400_000_000


@pytest.mark.parametrize(
    ("envelopes", "row", "changed", "said"),
    [
        (LOCKSTEP, 2, ZERO, f"message 3 ({PEDAL}/0, at byte "),
        (LOCKSTEP, 30, {"sample_time": EPOCH + LATER}, "message 31 "),
        (LOCKSTEP, 30, {"sample_time": EPOCH + 9_000_000}, f"message 33 ({PEDAL}/0, at byte "),
        (REALTIME, 7, ZERO, f"1 of 39 messages, the first is message 8 ({PEDAL}/0, at byte "),
        (REALTIME, 7, {"received": EPOCH + LATER}, f"message 9 ({PEDAL}/0, at byte "),
    ],
)
def test_times_that_cannot_be_right_are_told(
    tmp_path: Path, envelopes: list[Envelope], row: int, changed: dict[str, int], said: str
) -> None:
    changes = [each._replace(**changed) if number == row else each for number, each in enumerate(envelopes)]
    found = inspect(write(tmp_path / "a.rec", *changes))
    assert found.fault.startswith(said)
    assert found.duration_s < 10
    assert not inspect(write(tmp_path / "whole.rec", *envelopes)).fault


@pytest.mark.parametrize("envelopes", [LOCKSTEP, REALTIME])
def test_an_order_that_cannot_be_right_is_told(tmp_path: Path, envelopes: list[Envelope]) -> None:
    twice = inspect(write(tmp_path / "twice.rec", *envelopes[:21], *envelopes[20:])).fault
    assert " is there twice, as message 21 already" in twice
    late = [each._replace(received=each.received and each.received + 9_000_000) for each in envelopes[20:]]
    assert "goes back" in inspect(write(tmp_path / "swapped.rec", *late, *envelopes[:20])).fault


def test_a_player_may_begin_anew(tmp_path: Path) -> None:
    """With the times of its recording; one that the application sends is none."""
    playing = message("cluon.data.PlayerStatus", EPOCH)
    rounds = [message(PEDAL, WALL + second * 2_000_000) for _ in range(3) for second in range(3)]
    steps = [step(2, 0), begin(), *(each for n, m in enumerate(rounds, 3) for each in (m, step(n, n * 10_000)))]
    assert not inspect(write(tmp_path / "played.rec", playing, *steps)).fault
    forged = playing._replace(received=WALL)
    assert "goes back" in inspect(write(tmp_path / "forged.rec", forged, *steps)).fault
    lost = [each._replace(**ZERO) if each is rounds[4] else each for each in steps]
    assert inspect(write(tmp_path / "lost.rec", playing, *lost)).fault.startswith("message 12 ")


def test_bytes_that_are_no_message_are_told_but_at_the_end(tmp_path: Path) -> None:
    path = write(tmp_path / "a.rec", *LOCKSTEP)
    whole = path.read_bytes()
    path.write_bytes(whole[:-5])
    assert not inspect(path).fault
    path.write_bytes(whole[:100] + b"\x0d\xa4" + whole[100:])
    assert inspect(path).fault.startswith("skipped ")
