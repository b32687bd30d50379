"""The longest pause of an application's program between two answers in real time, by the recording of its test."""

from pathlib import Path

import numpy as np

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.bus.envelope import MICROSECONDS
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.frame_table import Fact
from dodo_dsl.opendlv.recordings.scan import Scanner
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.load.response import MOST_PERIODS
from dodo_dsl.run.recorded.test_recording import BEGIN
from dodo_dsl.run.run_state import pictured_by

_LEAST_MESSAGES = 10
"""Of one kind: fewer are no answers to frames."""


def long_pause(plan: Plan, folder: Path, recording: Path) -> str:
    """A sentence on the longest pause of a message that a service declares; empty where none is long.

    Long is more than ten periods of the frames, or of the message where that comes less often. ``folder`` is the
    compiled test's. Raises OSError and OdvdError.
    """
    messages = MessageSet.load(*(folder / FILES / path for path in plan.messages))
    came = _came(recording)
    begin = came[1][came[0] == messages.id(BEGIN)]
    worst, text = 0.0, ""
    for service in plan.application.services:
        for output in service.outputs:
            name, _, stamp = output.partition("/")
            if name not in messages.names():
                continue
            chosen = (came[0] == messages.id(name)) & (came[2] == int(stamp) if stamp else True)
            times = np.sort(came[1][chosen & (came[1] >= (begin[0] if len(begin) else 0))]) / MICROSECONDS
            if len(times) < _LEAST_MESSAGES:
                continue
            pauses = np.diff(times)
            periods = float(pauses.max()) / max(_period_s(plan), float(np.median(pauses)))
            if periods > max(worst, MOST_PERIODS):
                at = times[int(pauses.argmax())] - (begin[0] / MICROSECONDS if len(begin) else times[0])
                worst = periods
                text = (
                    f"application service '{service.name}' sent no {name.rpartition('.')[2]} for "
                    f"{pauses.max():.3g} s, as long as {periods:.0f} frames, after {at:.1f} s"
                )
    return text


def _came(recording: Path) -> Numbers:
    """Ids, times of receipt in us, and sender stamps of all messages that were on the bus: (3, messages)."""
    parts = [np.empty((3, 0), np.int64)]
    with regular_file.opened(recording) as stream:
        for batch in Scanner(stream).batches():
            rows = batch.table[Fact.DATA_TYPE], batch.times[1], batch.table[Fact.SENDER_STAMP]
            parts.append(np.stack(rows)[:, batch.times[1] > 0])
    found: Numbers = np.concatenate(parts, axis=1)
    return found


def _period_s(plan: Plan) -> float:
    """The longest period of the test's cameras; 0 where none tells its own, as a recording that is played."""
    cameras = pictured_by(plan)
    rates = [float(f.value) for s in plan.services if s.name in cameras for f in s.flags if f.name == "freq"]
    return 1 / min(rates) if rates and min(rates) > 0 else 0.0
