"""What a recording says of the test that it was made in."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
        begins, steps, ends = (recording.rows([messages.id(name)]) for name in (BEGIN, STEP, END))
        if not len(begins):
            raise NoTestRecording(
                f"{path}: has no {BEGIN} ({messages.id(BEGIN)}), with which every test begins; expected the recording "
                "of a test, such as dodo-report/sil-closed-straight/test.rec"
            )
        begin = recording.envelope(int(begins[0]))
        if len(steps):
            step = recording.envelope(int(steps[-1]))
            time: int = messages.decode(step.data_type, step.payload).time
            return TestRecording(path, "lockstep", _seconds(time - begin.sample_time))
        if not begin.received:
            raise NoTestRecording(
                f"{path}: has no {STEP} ({messages.id(STEP)}), which tells the steps of a test in lockstep apart; it "
                "was made by an earlier version of DoDo, so run the test again"
            )
        last = recording.envelope(int(ends[-1] if len(ends) else np.int64(len(recording) - 1)))
        return TestRecording(path, "realtime", _seconds((last.received or last.sample_time) - begin.received))


def _seconds(time: int) -> float:
    return max(0, time) / MICROSECONDS
