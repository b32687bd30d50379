"""A target from a recording: the field of a recorded message over its sample times."""

from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.recordings import timing
from dodo_dsl.opendlv.recordings.recording import Recording, RecordingError
from services.continuous_signal.signals import Signal
from services.continuous_signal.target import Target, TargetError, Values, in_order


def read_recording(path: Path, signal: Signal, messages: MessageSet) -> Target:
    """The target in a `.rec` file, its times from the first of all its messages. Raises TargetError.

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
                raise TargetError(f"{path}: has no {signal.message} of sender {signal.sender}{found}")
            if fault := timing.fault(recording, others) or timing.fault(recording, rows):
                raise TargetError(f"{path} cannot be a target: {fault}")
            times, first = index["time"][rows], int(timing.within(recording, others).min())
            return in_order(times - first, _values(path, list(recording.envelopes(rows)), signal, messages), first)
    except OSError as error:
        raise TargetError(f"{path}: cannot be read as a recording: {error.strerror}") from None
    except RecordingError as error:
        raise TargetError(str(error)) from None


def _values(path: Path, envelopes: list[Envelope], signal: Signal, messages: MessageSet) -> Values:
    values = np.empty(len(envelopes))
    for number, envelope in enumerate(envelopes):
        place = f"{path}: {signal} number {number + 1}"
        try:
            values[number] = signal.value(messages.decode(envelope.data_type, envelope.payload))
        except MessageError as error:
            raise TargetError(f"{place}: {error}") from None
        if not np.isfinite(values[number]):
            raise TargetError(f"{place}: {signal.field} is {values[number]}, expected a finite number")
    return values
