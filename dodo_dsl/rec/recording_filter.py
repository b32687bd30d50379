"""The part of a recording that a command works on, some messages and a time range, and its copy byte for byte."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording, matching
from dodo_dsl.opendlv.recording_writer import RecordingWriter

ABSOLUTE_S = 1e8  # seconds from here on are counted since 1970


class NothingSelected(Exception):
    """A selection that is invalid or without messages; one sentence."""

    usage = True


def rows_of(
    recording: Recording, known: MessageSet, messages: Sequence[str], start: float | None, end: float | None
) -> Numbers:
    """The rows in the order of the file; raises NothingSelected.

    ``messages`` are names or ids, each with ``/senderStamp`` for a single sender; none means all. ``start`` and ``end``
    are seconds since the recording's start, or since 1970.
    """
    times = recording.index["time"]
    begin = int(times[times != 0].min(initial=np.iinfo(np.int64).max))
    rows = recording.rows(start=_microseconds(start, begin), end=_microseconds(end, begin))
    if messages:
        try:
            rows = rows[matching(recording.index[rows], map(known.key, messages))]
        except MessageError as error:
            raise NothingSelected(str(error)) from None
    if not len(rows):
        raise NothingSelected(f"nothing selected: no message of {recording.path} is within --start, --end, --message")
    return rows


def _microseconds(seconds: float | None, begin: int) -> int | None:
    if seconds is None:
        return None
    return round(seconds * 1e6) + (0 if seconds >= ABSOLUTE_S else begin)


def copy_rows(recording: Recording, rows: Numbers, path: Path) -> None:
    """Writes rows unchanged into a new file; raises OSError and RecordingError."""
    with RecordingWriter(path) as writer:
        for batch in recording.batches(rows):
            writer.write_frames(batch.frames())
