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
        times = recording.index["time"]
        if not len(times):
            return RecordedTest()
        begins = recording.rows({messages.id(_BEGIN)})
        begin = int(times[begins[0]] if len(begins) else times.min())
        seconds = (times - begin) / MICROSECONDS
        walls = list[tuple[Numbers, Values]]()
        channels = tuple(_channels(recording, messages, np.flatnonzero(np.abs(seconds) < FAR), begin, walls))
        ends = seconds[recording.rows({messages.id(_END)})]
    last = max((float(c.times[-1]) for c in channels if len(c.times)), default=0.0)
    return RecordedTest(channels, max(float(ends[-1]) if len(ends) else last, 0.0), begin, *_clock(begin, walls))


def _clock(begin: int, pairs: list[tuple[Numbers, Values]]) -> tuple[Values, Values]:
    """Wall times ascending, and the latest test time until each, of messages that have both."""
    if not pairs:
        return np.empty(0), np.empty(0)
    walls, moments = (np.concatenate(each) for each in zip(*pairs, strict=True))
    known = (walls > 0) & (np.abs(walls - begin) > FAR * MICROSECONDS)
    if not known.any():  # in real time both are one; in lockstep departures may be the test's, too
        return np.array([begin, begin + FAR * MICROSECONDS]), np.array([0.0, FAR])
    walls, moments = walls[known], moments[known]
    order = np.argsort(walls, kind="stable")
    return walls[order].astype(np.float64), np.maximum.accumulate(moments[order])


def _channels(
    recording: Recording, messages: MessageSet, rows: Numbers, begin: int, walls: list[tuple[Numbers, Values]]
) -> Iterator[Channel]:
    index = recording.index[rows]
    keys = index["data_type"].astype(np.int64) << 32 | index["sender_stamp"]
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order])) + 1
    for group in np.split(rows[order], cuts)[:MOST_CHANNELS] if len(rows) else ():
        id_, sender = (int(recording.index[column][group[0]]) for column in ("data_type", "sender_stamp"))
        if id_ not in messages.ids() or (id_ in OWN_IDS and messages.name(id_) != _BEGIN):
            continue
        every = -(-len(group) // MOST_SAMPLES)
        if messages.name(id_) == PICTURES:
            times = (np.sort(recording.index["time"][group[::every]]) - begin) / MICROSECONDS
            yield Channel(PICTURES, sender, times, {}, every)
        else:
            yield _channel(recording, messages, id_, sender, group[::every], begin, every, walls)


def _channel(
    recording: Recording,
    messages: MessageSet,
    id_: int,
    sender: int,
    rows: Numbers,
    begin: int,
    every: int,
    walls: list[tuple[Numbers, Values]],
) -> Channel:
    """A channel; ``walls`` gets the times of arrival, or else of departure, with those of the test."""
    name = messages.name(id_)
    times, parts, goods = list[Values](), list[list[message_columns.Column]](), []
    for batch in recording.batches(rows):
        sent, received, sampled = batch.times
        found, good = message_columns.decode(
            messages.layout(name), batch.data, batch.table[Fact.PAYLOAD], batch.table[Fact.PAYLOAD_END]
        )
        arrived = np.where(received > 0, received, sent)
        times.append((np.where(sampled > 0, sampled, arrived) - begin) / MICROSECONDS)
        walls.append((arrived, times[-1]))
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
