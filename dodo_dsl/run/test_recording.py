"""What a recording says of its test: clock and duration."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.envelope import MICROSECONDS, Envelope
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.recording import Recording, RecordingError

_AROUND = 60 * MICROSECONDS
"""How far a message may lie behind the end of a recording."""
PLAYER = MessageSet.standard().id("cluon.data.PlayerStatus")
BEGIN, STEP, END = "dodo.TestBegin", "dodo.RecordedStep", "dodo.RecordingEnd"


@dataclass(frozen=True)
class TestRecording:
    """A recording of a test: its clock, and the test time in s that it lasts.

    ``fault`` says why nothing can be judged by it, empty if it is as recorders write it.
    """

    __test__ = False

    path: Path
    clock: str
    duration_s: float
    fault: str = ""


def inspect(path: Path) -> TestRecording:
    """The facts about a recording; raises OSError, and RecordingError also for one of no test."""
    messages = MessageSet.standard()
    with Recording(path) as recording:
        begins = recording.rows([messages.id(BEGIN)])
        if not len(begins):
            raise RecordingError(
                f"{path}: has no {BEGIN} ({messages.id(BEGIN)}), with which every test begins; expected the recording "
                "of a test, such as dodo-report/sil-closed-straight/test.rec"
            )
        begin = recording.envelope(int(begins[0]))
        step, end = (_last_mark(recording, messages.id(name)) for name in (STEP, END))
        if step is not None:
            steps = _step_marks(recording, messages)
            times = [time for _, _, time in steps]
            fault = _damage(recording) or _order_fault(recording, steps) or _own_fault(recording, messages)
            start = min(times) if fault else begin.sample_time
            return TestRecording(path, "lockstep", _seconds(max(times) - start), fault)
        if not begin.received:
            raise RecordingError(
                f"{path}: has no {STEP} ({messages.id(STEP)}), which separates the steps of a test in lockstep; it "
                "was made by an earlier version of DoDo, so run the test again"
            )
        last = end.sample_time if end else recording.envelope(len(recording) - 1).received
        fault = _damage(recording) or _arrivals_fault(recording, end)
        return TestRecording(path, "realtime", _seconds(last - begin.received), fault)


def _step_marks(recording: Recording, messages: MessageSet) -> list[tuple[int, int, int]]:
    """Row, number and time of each step's mark from the recorder itself."""
    id_ = messages.id(STEP)
    rows = [row for row in recording.rows([id_]).tolist() if not recording.envelope(row).received]
    said = (messages.decode(id_, recording.envelope(row).payload) for row in rows)
    return [(row, mark.number, mark.time) for row, mark in zip(rows, said, strict=True)]


def _order_fault(recording: Recording, steps: Sequence[tuple[int, int, int]]) -> str:
    """Steps that do not follow each other."""
    for (_, number, time), (row, next_number, next_time) in pairwise(steps):
        if next_number < number or (next_number == number) != (next_time == time) or next_time < time:
            return f"{recording_times.place(recording, row)} goes back, from step {number} to {next_number}"
    return ""


def _damage(recording: Recording) -> str:
    """What is not a message, but at the end of a file: the run was killed there."""
    places = [place for place in recording.damage.places if place.offset + place.size < recording.size]
    return f"{recording.damage}" if places else ""


def _own_fault(recording: Recording, messages: MessageSet) -> str:
    """What is wrong with messages of the test's services, which have no time of receipt; others may send anything.

    A player may begin its recording again, and then goes back to the times in it: steps alone give the order.
    """
    types, marks = recording.index["data_type"], [messages.id(name) for name in (BEGIN, STEP, END)]
    own = np.flatnonzero((_received(recording) == 0) & ~np.isin(types, marks))
    return recording_times.fault(recording, own, in_order=PLAYER not in types[own])


def _arrivals_fault(recording: Recording, end: Envelope | None) -> str:
    """What is wrong with the times of receipt, by which messages in real time are taken."""
    received = _received(recording)
    others = np.flatnonzero(~np.isin(recording.index["data_type"], list(OWN_IDS)))
    if len(missing := others[received[others] == 0]):
        where = recording_times.place(recording, int(missing[0]))
        return f"{len(missing):,} of {len(others):,} messages, the first is {where}, lack the time of their receipt"
    rows = np.flatnonzero(received)
    times = received[rows]
    for at in np.flatnonzero(np.diff(times) < -recording_times.MOST_BACK).tolist():
        back = float(times[at] - times[at + 1]) / 1e6
        return f"{recording_times.place(recording, int(rows[at + 1]))} goes back in time, by {back:,.6g} s"
    over = rows[times > end.sample_time + _AROUND] if end else rows[1:][np.diff(times) > recording_times.DAY]
    if len(over):
        return f"{recording_times.place(recording, int(over[0]))} was received after the end of the recording"
    return recording_times.repeated(recording, rows)


def _received(recording: Recording) -> Numbers:
    """When each message was received, in us; 0 for those of a recorder itself, and of services in lockstep."""
    parts = [batch.times[1] for batch in recording.batches()]
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def _last_mark(recording: Recording, id_: int) -> Envelope | None:
    """The last message with an id from the recorder itself; those that were on the bus were received at some time."""
    rows = recording.rows([id_]).tolist()
    return next((mark for row in reversed(rows) if not (mark := recording.envelope(row)).received), None)


def _seconds(time: int) -> float:
    return max(0, time) / MICROSECONDS
