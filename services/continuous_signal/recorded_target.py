"""A target from a recording: the field of a recorded message over its sample times."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import read_envelopes
from services.continuous_signal.signals import Signal
from services.continuous_signal.target import Target, TargetError, Values, in_order


def read_recording(path: Path, signal: Signal, messages: MessageSet) -> Target:
    """The target in a `.rec` file, its times from the first of all its messages. Raises TargetError.

    Messages are put in the order of their times; of those with one and the same time the last counts.
    """
    id_ = messages.id(signal.message)
    first: int | None = None
    others: Counter[int] = Counter()
    chosen: list[Envelope] = []
    for envelope in _envelopes(path):
        time = time_of(envelope)
        first = time if first is None else min(first, time)
        if (envelope.data_type, envelope.sender_stamp) == (id_, signal.sender):
            chosen.append(envelope)
        elif envelope.data_type == id_:
            others[envelope.sender_stamp] += 1
    if not chosen or first is None:
        found = f", but of {', '.join(map(str, sorted(others)))}" if others else ""
        raise TargetError(f"{path}: has no {signal.message} of sender {signal.sender}{found}")
    times = np.array([time_of(envelope) for envelope in chosen], np.int64)
    return in_order(times - first, _values(path, chosen, signal, messages), first)


def time_of(envelope: Envelope) -> int:
    """The sample time, or where that is zero when the message was received, or else sent."""
    return envelope.sample_time or envelope.received or envelope.sent


def _envelopes(path: Path) -> Iterator[Envelope]:
    try:
        yield from read_envelopes(path)
    except OSError as error:
        raise TargetError(f"{path}: cannot be read as a recording: {error.strerror}") from None


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
