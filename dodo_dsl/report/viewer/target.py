"""The target of a judged signal, over the test's time: a table, a recording, or another message of the test."""

import csv
import io
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.report.viewer import recorded
from dodo_dsl.report.viewer.recorded import MICROSECONDS, RecordedTest, Values

_FAR_S = 86_400.0

EMPTY = (np.empty(0), np.empty(0))

Samples = tuple[Values, Values]
"""Times in s of the test, and values."""


def from_table(path: Path, field: str, is_sample_time: bool, begin: int) -> Samples:
    """A CSV table; with ``is_sample_time`` its times are seconds since 1970. Raises OSError and ValueError."""
    rows = [row for row in csv.reader(io.StringIO(regular_file.text(path, encoding="utf-8-sig"), newline="")) if row]
    header = [name.strip() for name in rows[0]] if rows else []
    column = header.index(field if field in header else "value")
    at = header.index("time")
    times = np.array([float(row[at]) for row in rows[1:]])
    values = np.array([float(row[column]) for row in rows[1:]])
    return (_aligned(times, begin) if is_sample_time and len(times) else times), values


def from_recording(
    path: Path, message: str, sender: int, field: str, messages: MessageSet, test: RecordedTest, is_sample_time: bool
) -> Samples:
    """A recorded message, its times from the first of all messages of that file; raises OSError and ValueError."""
    source = recorded.read(path, messages, {(message, sender)})
    channel = source.channel(message, sender)
    if channel is None:
        raise ValueError(f"{path} has no {message} of sender {sender}")
    first = min(float(c.times[0]) for c in source.channels if len(c.times))
    offset = (source.begin - test.begin) / MICROSECONDS
    times = channel.times + offset if is_sample_time and abs(offset) < _FAR_S else channel.times - first
    return times, channel.numbers(field)


def from_channel(test: RecordedTest, message: str, sender: int, field: str) -> Samples:
    """Another message of the test."""
    channel = test.channel(message, sender)
    return (channel.times, channel.numbers(field)) if channel else EMPTY


def _aligned(times: Values, begin: int) -> Values:
    """Seconds since 1970 in the test's time, or from the first on where they are of another day."""
    since = times - begin / MICROSECONDS
    return since if np.abs(since).max() < _FAR_S else times - times[0]
