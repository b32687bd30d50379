"""What a recording says of the test that it was made in."""

from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import Recording, RecordingError

MICROSECONDS = 1_000_000
BEGIN, STEP, END = "dodo.TestBegin", "dodo.RecordedStep", "dodo.RecordingEnd"


class NoTestRecording(RecordingError):
    """A recording by which no test can be judged."""


@dataclass(frozen=True)
class TestRecording:
    """A recording of a test: its clock, and the test time in s that it lasts."""

    __test__ = False

    path: Path
    clock: str
    duration_s: float


def inspect(path: Path) -> TestRecording:
    """The facts about a recording; raises OSError, RecordingError, and NoTestRecording for one of no test."""
    messages = MessageSet.standard()
    with Recording(path) as recording:
        begins = recording.rows([messages.id(BEGIN)])
        if not len(begins):
            raise NoTestRecording(
                f"{path}: has no {BEGIN} ({messages.id(BEGIN)}), with which every test begins; expected the recording "
                "of a test, such as dodo-report/sil-closed-straight/test.rec"
            )
        begin = recording.envelope(int(begins[0]))
        step, end = (_last_mark(recording, messages.id(name)) for name in (STEP, END))
        if step is not None:
            time: int = messages.decode(step.data_type, step.payload).time
            return TestRecording(path, "lockstep", _seconds(time - begin.sample_time))
        if not begin.received:
            raise NoTestRecording(
                f"{path}: has no {STEP} ({messages.id(STEP)}), which tells the steps of a test in lockstep apart; it "
                "was made by an earlier version of DoDo, so run the test again"
            )
        last = end.sample_time if end else recording.envelope(len(recording) - 1).received
        return TestRecording(path, "realtime", _seconds(last - begin.received))


def _last_mark(recording: Recording, id_: int) -> Envelope | None:
    """The last message with an id from the recorder itself; those that were on the bus were received at some time."""
    rows = recording.rows([id_]).tolist()
    return next((mark for row in reversed(rows) if not (mark := recording.envelope(row)).received), None)


def _seconds(time: int) -> float:
    return max(0, time) / MICROSECONDS
