"""What was on the bus of a finished test, as columns over the test's own time."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import message_columns
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageSet
from dodo_dsl.opendlv.recording import Recording

Values = NDArray[np.float64]

MICROSECONDS = 1_000_000
MOST_SAMPLES = 20_000
"""Samples of one channel that are read; of more, every second, third and so on."""
MOST_CHANNELS = 200
FAR = 86_400.0
"""s from the start of the test, beyond which a time is of another clock."""
FRAME = "opendlv.sim.Frame"
PICTURES = "opendlv.proxy.ImageReading"
"""Whose data is not read here."""
_BEGIN, _END = "dodo.TestBegin", "dodo.RecordingEnd"


@dataclass(frozen=True)
class Channel:
    """A message of one sender: ``times`` in s of the test, ascending, and each field's values in the same order.

    Strings and bytes are lists of bytes. ``every`` is 2 where only every second sample is here.
    """

    message: str
    sender: int
    times: Values
    fields: dict[str, NDArray[np.generic] | list[bytes]]
    every: int = 1

    def numbers(self, name: str) -> Values:
        """A field as numbers; all NaN if there is no such field of numbers."""
        values = self.fields.get(name)
        if values is None or isinstance(values, list):
            return np.full(len(self.times), np.nan)
        return values.astype(np.float64)


@dataclass(frozen=True)
class RecordedTest:
    """All channels; ``duration`` in s. ``begin`` is the sample time of the test's begin, or else the first, in us.

    ``walls`` are times of the machine in us since the epoch, ascending, and ``moments`` the test's times then, in s.
    """

    channels: tuple[Channel, ...] = ()
    duration: float = 0.0
    begin: int = 0
    walls: Values = field(default_factory=lambda: np.empty(0))
    moments: Values = field(default_factory=lambda: np.empty(0))

    def channel(self, message: str, sender: int) -> Channel | None:
        return next((c for c in self.channels if (c.message, c.sender) == (message, sender)), None)


def read(path: Path, messages: MessageSet) -> RecordedTest:
    """The recording of a test; raises OSError and RecordingError."""
    with Recording(path) as recording:
        index = recording.index
        begins = recording.rows({messages.id(_BEGIN)})
        times, rows = index["time"], np.arange(len(index))
        if len(begins):
            begin = int(times[begins[0]])
        elif len(index):
            begin = int(times.min())
        else:
            return RecordedTest()
        seconds = (times - begin) / MICROSECONDS
        rows = rows[np.abs(seconds) < FAR]
        clock = _Clock(begin)
        channels = list(_channels(recording, messages, rows, clock))
        ends = seconds[recording.rows({messages.id(_END)})]
    last = max((float(c.times[-1]) for c in channels if len(c.times)), default=0.0)
    duration = float(ends[-1]) if len(ends) else last
    return RecordedTest(tuple(channels), max(duration, 0.0), begin, *clock.table())


class _Clock:
    """Pairs of wall time and test time, from messages that have both."""

    def __init__(self, begin: int) -> None:
        self._begin = begin
        self._walls: list[Numbers] = []
        self._moments: list[Values] = []

    def seconds(self, sampled: Numbers) -> Values:
        found: Values = (sampled - self._begin) / MICROSECONDS
        return found

    def note(self, sent: Numbers, received: Numbers, sampled: Numbers) -> None:
        """Messages whose sample time is the test's, and whose arrival, or else departure, is the machine's."""
        self._walls.append(np.where(received > 0, received, sent))
        self._moments.append(self.seconds(sampled))

    def table(self) -> tuple[Values, Values]:
        """Wall times ascending, and the latest test time until each."""
        if not self._walls:
            return np.empty(0), np.empty(0)
        walls, moments = np.concatenate(self._walls), np.concatenate(self._moments)
        known = (walls > 0) & (np.abs(walls - self._begin) > FAR * MICROSECONDS)
        if not known.any():  # in real time both are one; in lockstep departures may be the test's, too
            return np.array([self._begin, self._begin + FAR * MICROSECONDS]), np.array([0.0, FAR])
        walls, moments = walls[known], moments[known]
        order = np.argsort(walls, kind="stable")
        walls, moments = walls[order], np.maximum.accumulate(moments[order])
        return walls.astype(np.float64), moments


def _channels(recording: Recording, messages: MessageSet, rows: Numbers, clock: _Clock) -> Iterator[Channel]:
    index = recording.index[rows]
    keys = index["data_type"].astype(np.int64) << 32 | index["sender_stamp"]
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order])) + 1
    for group in np.split(rows[order], cuts)[:MOST_CHANNELS] if len(rows) else ():
        id_ = int(recording.index["data_type"][group[0]])
        if id_ not in messages.ids():
            continue
        name = messages.name(id_)
        if id_ in OWN_IDS and name != _BEGIN:
            continue
        sender = int(recording.index["sender_stamp"][group[0]])
        every = -(-len(group) // MOST_SAMPLES)
        if name == PICTURES:
            yield Channel(name, sender, clock.seconds(np.sort(recording.index["time"][group[::every]])), {}, every)
            continue
        yield _channel(recording, messages, name, sender, group[::every], clock, every)


def _channel(
    recording: Recording, messages: MessageSet, name: str, sender: int, rows: Numbers, clock: _Clock, every: int
) -> Channel:
    times, parts = list[Values](), list[list[message_columns.Column]]()
    goods = []
    for batch in recording.batches(rows):
        sent, received, sampled = batch.times
        table = batch.table
        found, good = message_columns.decode(
            messages.layout(name), batch.data, table[Fact.PAYLOAD], table[Fact.PAYLOAD_END]
        )
        moments = np.where(sampled > 0, sampled, np.where(received > 0, received, sent))
        clock.note(sent, received, moments)
        times.append(clock.seconds(moments))
        parts.append(found)
        goods.append(good)
    seconds, good = np.concatenate(times), np.concatenate(goods)
    chosen = np.flatnonzero(good)[np.argsort(seconds[good], kind="stable")]
    fields = {
        column.name: _chosen([part[number].values for part in parts], chosen) for number, column in enumerate(parts[0])
    }
    return Channel(name, sender, seconds[chosen], fields, every)


def _chosen(parts: list[NDArray[np.generic] | list[bytes]], rows: Numbers) -> NDArray[np.generic] | list[bytes]:
    if isinstance(parts[0], list):
        together = [value for part in parts for value in part]
        return [together[row] for row in rows.tolist()]
    joined: NDArray[np.generic] = np.concatenate(parts)[rows]
    return joined
