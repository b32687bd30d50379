"""The part of a recording that a command works on, some messages and a time range, and its copy byte for byte."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Excerpt:
    """``messages`` are names or ids, each with ``/senderStamp`` for a single sender; none means all.

    ``start`` and ``end`` are seconds since the recording's start, or since 1970.
    """

    messages: Sequence[str] = ()
    start: float | None = None
    end: float | None = None

    def rows(self, recording: Recording, known: MessageSet) -> Numbers:
        """The rows in the order of the file; raises NothingSelected."""
        times = recording.index["time"]
        begin = int(times[times != 0].min(initial=np.iinfo(np.int64).max))
        rows = recording.rows(start=_microseconds(self.start, begin), end=_microseconds(self.end, begin))
        if self.messages:
            try:
                rows = rows[matching(recording.index[rows], map(known.key, self.messages))]
            except MessageError as error:
                raise NothingSelected(str(error)) from None
        if not len(rows):
            raise NothingSelected(f"nothing selected: no message of {recording.path} matches {self}")
        return rows

    def __str__(self) -> str:
        options = [f"--message {message}" for message in self.messages]
        options += [f"--start {self.start:g}"] if self.start is not None else []
        options += [f"--end {self.end:g}"] if self.end is not None else []
        return " ".join(options)


def _microseconds(seconds: float | None, begin: int) -> int | None:
    if seconds is None:
        return None
    return round(seconds * 1e6) + (0 if seconds >= ABSOLUTE_S else begin)


def copy_rows(recording: Recording, rows: Numbers, path: Path, progress: Callable[[int], None]) -> None:
    """Writes rows unchanged into a new file; ``progress`` gets the number of rows done.

    Raises OSError and RecordingError.
    """
    with RecordingWriter(path) as writer:
        for batch in recording.batches(rows):
            writer.write_frames(batch.frames())
            progress(writer.frames)
