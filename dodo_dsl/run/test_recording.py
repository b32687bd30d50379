"""What a recording says of its test: clock and duration, the longest pause of a program, and which one stayed silent.

A pause is between two answers of the application in real time. A silent program got messages of another one and sent
nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv import recording_times, regular_file
from dodo_dsl.opendlv.envelope import MICROSECONDS, Envelope
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.recording import Recording, RecordingError, Scanner
from dodo_dsl.plan.model import ApplicationService, Plan
from dodo_dsl.run.machine_load.judgement import MOST_PERIODS
from dodo_dsl.run.run_state import pictured_by

_AROUND = 60 * MICROSECONDS
"""How far a mark may lie from the steps, and a message behind the end of a recording."""
PLAYER = MessageSet.standard().id("cluon.data.PlayerStatus")
BEGIN, STEP, END = "dodo.TestBegin", "dodo.RecordedStep", "dodo.RecordingEnd"


class NoTestRecording(RecordingError):
    """A recording by which no test can be judged."""


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
            marks = Marks.read(recording, messages)
            times = [time for _, _, time in marks.steps]
            fault = _damage(recording) or marks.fault(begins) or _own_fault(recording, marks)
            start = min(times) if fault else begin.sample_time
            return TestRecording(path, "lockstep", _seconds(max(times) - start), fault)
        if not begin.received:
            raise NoTestRecording(
                f"{path}: has no {STEP} ({messages.id(STEP)}), which separates the steps of a test in lockstep; it "
                "was made by an earlier version of DoDo, so run the test again"
            )
        last = end.sample_time if end else recording.envelope(len(recording) - 1).received
        fault = _damage(recording) or _arrivals_fault(recording, end)
        return TestRecording(path, "realtime", _seconds(last - begin.received), fault)


@dataclass(frozen=True)
class Marks:
    """The marks of a recording in lockstep: row, number and time of each step's, and their ids."""

    recording: Recording
    steps: tuple[tuple[int, int, int], ...]
    ids: tuple[int, ...]

    @classmethod
    def read(cls, recording: Recording, messages: MessageSet) -> Self:
        id_ = messages.id(STEP)
        rows = [row for row in recording.rows([id_]).tolist() if not recording.envelope(row).received]
        said = (messages.decode(id_, recording.envelope(row).payload) for row in rows)
        steps = tuple((row, mark.number, mark.time) for row, mark in zip(rows, said, strict=True))
        return cls(recording, steps, (id_, messages.id(END), messages.id(BEGIN)))

    def fault(self, begins: Numbers) -> str:
        """Steps that do not follow each other, and marks or a start that lie elsewhere."""
        for (_, number, time), (row, next_number, next_time) in pairwise(self.steps):
            where = recording_times.place(self.recording, row)
            if next_number < number or (next_number == number) != (next_time == time) or next_time < time:
                return f"{where} goes back, from step {number} to {next_number}"
        times = [time for _, _, time in self.steps]
        rows = self.recording.rows(self.ids)
        sampled = self.recording.index["sampled"][rows]
        apart = rows[(sampled < min(times) - _AROUND) | (sampled > max(times) + _AROUND)]
        wrong = [row for row in apart.tolist() if row in begins or not self.recording.envelope(row).received]
        if wrong:
            some, have = (
                ("1 mark", "has a time stamp") if len(wrong) == 1 else (f"{len(wrong):,} marks", "have time stamps")
            )
            where = recording_times.place(self.recording, wrong[0])
            return f"{some} of the test {have} outside its steps, the first is {where}"
        return ""


def _damage(recording: Recording) -> str:
    """What is not a message, but at the end of a file: the run was killed there."""
    places = [place for place in recording.damage.places if place.offset + place.size < recording.size]
    return f"{recording.damage}" if places else ""


def _own_fault(recording: Recording, marks: Marks) -> str:
    """What is wrong with messages of the test's services, which have no time of receipt; others may send anything.

    A player may begin its recording again, and then goes back to the times in it: steps alone give the order.
    """
    received = _received(recording)
    own = np.flatnonzero((received == 0) & ~np.isin(recording.index["data_type"], list(marks.ids)))
    in_order = PLAYER not in recording.index["data_type"][own]
    for rows in recording_times.streams(recording.index, own):
        if fault := _apart(recording, rows) or recording_times.fault(recording, rows, in_order):
            return fault
    return recording_times.repeated(recording, np.flatnonzero(received == 0)) if in_order else ""


def _apart(recording: Recording, rows: Numbers) -> str:
    """Sample times, which alone count in lockstep, far from the others of the same message and sender."""
    sampled = recording.index["sampled"][rows]
    wrong = rows[~recording_times.together(sampled)]
    if not len(wrong):
        return ""
    stamps = "a time stamp" if len(wrong) == 1 else "time stamps"
    count = f"{len(wrong):,} of {len(rows):,} messages"
    return (
        f"{count}, the first is {recording_times.place(recording, int(wrong[0]))}, with {stamps} far from the others'"
    )


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
        back = recording_times.span(float(times[at] - times[at + 1]) / 1e6)
        return f"{recording_times.place(recording, int(rows[at + 1]))} goes back in time, by {back}"
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


_LEAST_MESSAGES = 10
"""Of one kind: fewer are not answers to frames."""


def long_pause(plan: Plan, folder: Path, recording: Path) -> str:
    """A sentence on the longest pause of a message that a service declares; empty if none is long.

    Long is more than ten periods of the frames, or of the message where that comes less often. ``folder`` is the
    compiled test's. Raises OSError and OdvdError.
    """
    came, messages = _came(recording), MessageSet.load(*(folder / FILES / path for path in plan.messages))
    came = came[:, came[1] > 0]  # what was on the bus
    begins = _of(BEGIN, came, messages)[1] / MICROSECONDS
    worst, text = 0.0, ""
    for service in plan.application.services:
        for output in service.outputs:
            times = np.sort(_of(output, came, messages)[1]) / MICROSECONDS
            times = times[times >= begins[0]] if len(begins) else times
            if len(times) < _LEAST_MESSAGES:
                continue
            pauses = np.diff(times)
            periods = float(pauses.max()) / max(_period_s(plan), float(np.median(pauses)))
            if periods > max(worst, MOST_PERIODS):
                at = times[int(pauses.argmax())] - (begins[0] if len(begins) else times[0])
                name = output.partition("/")[0].rpartition(".")[2]
                worst = periods
                text = (
                    f"application service '{service.name}' sent no {name} for "
                    f"{pauses.max():.3g} s, as long as {periods:.0f} frames, after {at:.1f} s"
                )
    return text


def _came(recording: Path) -> Numbers:
    """Ids, times of receipt in us, and sender stamps of all messages: (3, messages)."""
    parts = [np.empty((3, 0), np.int64)]
    with regular_file.opened(recording) as stream:
        for batch in Scanner(stream).batches():
            parts.append(np.stack((batch.table[Fact.DATA_TYPE], batch.times[1], batch.table[Fact.SENDER_STAMP])))
    found: Numbers = np.concatenate(parts, axis=1)
    return found


def _of(message: str, came: Numbers, messages: MessageSet) -> Numbers:
    """Those of a message, under any sender stamp if it names none."""
    name, _, stamp = message.partition("/")
    is_known = name in messages.names()
    chosen = (came[0] == messages.id(name)) & (not stamp or came[2] == int(stamp)) if is_known else []
    found: Numbers = came[:, chosen]
    return found


def _period_s(plan: Plan) -> float:
    """The longest period of the test's cameras; 0 if none has its own, as a recording that is played."""
    cameras = pictured_by(plan)
    rates = [float(f.value) for s in plan.services if s.name in cameras for f in s.flags if f.name == "freq"]
    return 1 / min(rates) if rates and min(rates) > 0 else 0.0


def silent_consumer(plan: Plan, folder: Path, recording: Path) -> str:
    """The first program that got messages and sent none, in half a sentence, or empty; ``folder`` is the test's.

    Raises OSError and OdvdError.
    """
    came, messages = _came(recording), MessageSet.load(*(folder / FILES / path for path in plan.messages))
    services = plan.application.services
    for consumer in services:
        if consumer.outputs and not any(_of(message, came, messages).size for message in consumer.outputs):
            for message in consumer.inputs:
                producer = _producer(message, [s for s in services if s is not consumer])
                if producer and _of(message, came, messages).size:
                    return f"{message} came from '{producer}', but '{consumer.name}', which consumes it, sent nothing"
    return ""


def _producer(message: str, services: Sequence[ApplicationService]) -> str:
    """The service that declares a message, under any sender stamp where one of both names none; empty if none does."""
    name, _, stamp = message.partition("/")
    for service in services:
        for output in service.outputs:
            its_name, _, its_stamp = output.partition("/")
            if its_name == name and (its_stamp == stamp or not its_stamp or not stamp):
                return service.name
    return ""
