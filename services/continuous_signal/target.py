"""A signal, which is a field of a message, and its target, from a CSV table or a recording.

A target is samples in the order of their times, and straight lines between them. That from a recording is the field of
a recorded message over its sample times.
"""

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.assets.table import read_target
from dodo_dsl.opendlv.envelope import MICROSECONDS, Envelope
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording, RecordingError

Times = NDArray[np.int64]
"""Microseconds."""

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """`values` at `times`, which increase strictly, in microseconds from `start`, itself in microseconds."""

    times: Times
    values: Values
    start: int = 0

    def at(self, times: Times) -> Values:
        """The target at any times by linear interpolation (thesis 4.3.2); NaN before its start and after its end."""
        if not len(self.times):
            return np.full(len(times), np.nan)
        first = self.times[0]
        places, knots = (times - first).astype(np.float64), (self.times - first).astype(np.float64)
        values: Values = np.interp(places, knots, self.values, left=np.nan, right=np.nan)
        return values

    @property
    def span(self) -> tuple[float, float]:
        """Where it begins and ends, in seconds from `start`."""
        return float(self.times[0]) / MICROSECONDS, float(self.times[-1]) / MICROSECONDS


def in_order(times: Times, values: Values, start: int = 0) -> Target:
    """The target of samples in any order; of those with one and the same time the last counts."""
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    last = np.append(times[1:] != times[:-1], True)[: len(times)]
    return Target(times[last], values[last], start)


def read_table(path: Path, field: str, from_first: bool) -> Target:
    """The target in a table: the column named `field`, or else `value`, over `time`.

    Times count from zero, or `from_first` row on. Raises InputError.
    """
    samples = read_target(path, field)
    times = np.array([time for time, _ in samples], np.int64)
    start = int(times[0]) if from_first else 0
    return Target(times - start, np.array([value for _, value in samples]), start)


@dataclass(frozen=True)
class Signal:
    """A number in a message: the message's full name, its sender stamp, and the field."""

    message: str
    sender: int
    field: str

    def value(self, message: Any) -> float:
        return float(getattr(message, self.field))

    def __str__(self) -> str:
        return f"{self.message}/{self.sender}"


def check(signal: Signal, messages: MessageSet) -> Signal:
    """The signal itself; raises UnknownMessage, and ValueError for a field that is unknown or not a number."""
    definition = messages.layout(signal.message).definition
    fields = [field.name for field in definition.fields]
    if signal.field not in fields:
        close = difflib.get_close_matches(signal.field, fields, n=1)
        hint = f"did you mean '{close[0]}'?" if close else f"it has {', '.join(fields) or 'none'}"
        raise ValueError(f"{signal.message} has no field '{signal.field}'; {hint}")
    if signal.field not in definition.numbers:
        raise ValueError(f"the field {signal.field} of {signal.message} is not a number")
    return signal


def is_single(signal: Signal, messages: MessageSet) -> bool:
    """Whether the field of a checked signal is a float, not a double."""
    return messages.layout(signal.message).definition.numbers[signal.field]


def read_recording(path: Path, signal: Signal, messages: MessageSet) -> Target:
    """The target in a `.rec` file, its times from the first of all its messages. Raises InputError.

    Messages are put in the order of their times; of those with one and the same time the last counts.
    """
    id_ = messages.id(signal.message)
    try:
        with Recording(path) as recording:
            index = recording.index
            others = np.flatnonzero(~np.isin(index["data_type"], list(OWN_IDS)))
            rows = recording.rows([id_], sender_stamps=[signal.sender])
            if not len(rows):
                senders = np.unique(index["sender_stamp"][index["data_type"] == id_]).tolist()
                found = f", but of {', '.join(map(str, senders))}" if senders else ""
                raise InputError(path, f"has no {signal.message} of sender {signal.sender}{found}")
            if fault := recording_times.fault(recording, others) or recording_times.fault(recording, rows):
                raise InputError(path, f"cannot be a target: {fault}")
            times, first = index["time"][rows], int(recording_times.within(recording, others).min())
            return in_order(times - first, _values(path, list(recording.envelopes(rows)), signal, messages), first)
    except OSError as error:
        raise InputError(path, f"cannot be read as a recording: {error.strerror}") from None
    except RecordingError as error:
        raise InputError(path, str(error).removeprefix(f"{path} ")) from None


def picture_times(path: Path, sender: int, start: int) -> Times | None:
    """When the pictures of a camera in a ``.rec`` file were taken, in us from ``start``; None if it has none."""
    with Recording(path) as recording:
        times: Times = np.unique(recording.index["time"][recording.rows([IMAGE], sender_stamps=[sender])])
    return times - start if len(times) else None


def due_times(path: Path, sender: int, start: float, end: float | None, timemod: float) -> Times:
    """When a player shows the pictures of a camera in a recording, in us from its start, with gaps of 1 s at most."""
    with Recording(path) as recording:
        rows, _, due = recording_times.played(recording, start, end, MICROSECONDS, timemod)
        return due[np.isin(rows, recording.rows([IMAGE], sender_stamps=[sender]))]


def _values(path: Path, envelopes: list[Envelope], signal: Signal, messages: MessageSet) -> Values:
    values = np.empty(len(envelopes))
    for number, envelope in enumerate(envelopes):
        place = f"{signal} number {number + 1}"
        try:
            values[number] = signal.value(messages.decode(envelope.data_type, envelope.payload))
        except MessageError as error:
            raise InputError(path, f"{place}: {error}") from None
        if not np.isfinite(values[number]):
            raise InputError(path, f"{place}: {signal.field} is {values[number]}, expected a finite number")
    return values
