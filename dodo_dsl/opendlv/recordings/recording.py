"""Recordings (``.rec``): frames one after the other, without header or footer, read as a stream or by an index.

A recording may be cut, hold garbage, be unsorted or have sample times of zero: what is not a frame is skipped
and noted in a :class:``Damage``.
"""

import os
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.messages.varints import Marks, Numbers
from dodo_dsl.opendlv.recordings import frame_table
from dodo_dsl.opendlv.recordings.damage import Damage
from dodo_dsl.opendlv.recordings.frame_table import PADDING, Fact
from dodo_dsl.opendlv.recordings.scan import Batch, Scanner

__all__ = ["Batch", "Damage", "Recording", "RecordingError", "read_envelopes"]

BATCH_FRAMES = 1 << 12
BATCH_BYTES = 4 << 20
_NEAR = 1 << 16  # bytes between frames that are read rather than jumped over

_INDEX = np.dtype(
    [
        ("offset", "<i8"),
        ("sampled", "<i8"),
        ("time", "<i8"),
        ("size", "<u4"),
        ("data_type", "<i4"),
        ("sender_stamp", "<u4"),
    ],
    align=False,
)


class RecordingError(ValueError):
    """A file that is not a recording, or that changed while it was read."""


def read_envelopes(path: Path, damage: Callable[[Damage], None] | None = None) -> Iterator[Envelope]:
    """The envelopes of a recording in file order; ``damage`` gets what was skipped at the end.

    Memory is bounded by the largest frame, 16 MiB. Raises OSError for an unreadable file.
    """
    with regular_file.opened(path) as stream:
        scanner = Scanner(stream)
        for batch in scanner.batches():
            yield from batch.envelopes()
    if damage is not None:
        damage(scanner.damage)


class Recording:
    """A recording with an index: a context manager whose rows can be chosen, sorted and read in any order.

    The index takes 36 bytes of memory a message; ``index`` has the columns offset, size (bytes), data_type,
    sender_stamp, sampled and time (microseconds since the epoch), a row for each message in the order of the file.
    ``time`` is the sample time, or where that is zero when the message was received, or else sent.
    """

    def __init__(self, path: Path, progress: Callable[[int], None] | None = None) -> None:
        """Read all of a file once; ``progress`` gets the number of bytes read.

        Raises OSError for an unreadable file and for what is none, RecordingError for one without a single message.
        """
        self.path = path
        self._stream: BinaryIO = regular_file.opened(path)
        try:
            self.size = os.fstat(self._stream.fileno()).st_size
            self.damage, self.index = _indexed(self._stream, progress)
            self._refuse_others()
        except BaseException:
            self._stream.close()
            raise

    def __len__(self) -> int:
        return len(self.index)

    def rows(
        self,
        messages: Collection[int] | None = None,
        start: int | None = None,
        end: int | None = None,
        sender_stamps: Collection[int] | None = None,
    ) -> Numbers:
        """Rows in the order of the file: of some messages and senders, ``time`` from ``start`` to before ``end``."""
        chosen: Marks = np.ones(len(self.index), np.bool_)
        if messages is not None:
            chosen &= np.isin(self.index["data_type"], list(messages))
        if sender_stamps is not None:
            chosen &= np.isin(self.index["sender_stamp"], list(sender_stamps))
        if start is not None:
            chosen &= self.index["time"] >= start
        if end is not None:
            chosen &= self.index["time"] < end
        return np.flatnonzero(chosen)

    def by_time(self, rows: Numbers | None = None) -> Numbers:
        """Rows in the order of their sample times; equal ones stay in the order of the file."""
        chosen = np.arange(len(self.index)) if rows is None else rows
        ordered: Numbers = chosen[np.argsort(self.index["sampled"][chosen], kind="stable")]
        return ordered

    def batches(self, rows: Numbers | None = None) -> Iterator[Batch]:
        """The frames of some rows in the order given (by default all), some at a time.

        Raises RecordingError if the file has changed.
        """
        wanted = np.arange(len(self.index)) if rows is None else rows
        ends = np.cumsum(self.index["size"][wanted].astype(np.int64))
        first = 0
        while first < len(wanted):
            behind = ends[first - 1] if first else 0
            most = int(np.searchsorted(ends, behind + BATCH_BYTES, "right"))
            last = max(first + 1, min(first + BATCH_FRAMES, most))
            yield self._gathered(wanted[first:last])
            first = last

    def envelopes(self, rows: Numbers | None = None) -> Iterator[Envelope]:
        """The envelopes of some rows in the order given (by default all)."""
        for batch in self.batches(rows):
            yield from batch.envelopes()

    def envelope(self, row: int) -> Envelope:
        """The envelope of one row."""
        return next(self._gathered(np.array([row])).envelopes())

    def close(self) -> None:
        """Let go of the file."""
        self._stream.close()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _refuse_others(self) -> None:
        if self.size and not len(self.index):
            raise RecordingError(f"{self.path} is not a recording: its {self.size} bytes hold no message")

    def _gathered(self, rows: Numbers) -> Batch:
        """Read frames that lie near one another with one call."""
        order = np.argsort(self.index["offset"][rows], kind="stable")
        offsets, sizes = self.index["offset"][rows[order]], self.index["size"][rows[order]].astype(np.int64)
        cuts = np.flatnonzero(offsets[1:] - (offsets[:-1] + sizes[:-1]) > _NEAR) + 1
        pieces, starts, at = [], np.empty(len(rows), np.int64), 0
        for some in np.split(np.arange(len(rows)), cuts):
            first, end = int(offsets[some[0]]), int(offsets[some[-1]] + sizes[some[-1]])
            pieces.append(os.pread(self._stream.fileno(), end - first, first))
            starts[some] = offsets[some] - first + at
            at += end - first
        data = b"".join((*pieces, PADDING))
        if len(data) != at + len(PADDING):
            raise RecordingError(f"{self.path} has become shorter while it was read")
        table = frame_table.read_frames(data, starts.tolist(), (starts + sizes).tolist(), known=True)
        if table.shape[1] != len(rows):
            raise RecordingError(f"{self.path} has changed while it was read")
        back = np.empty(len(rows), np.int64)
        back[order] = np.arange(len(rows))
        return Batch(data, -1, table[:, back])


def _indexed(stream: BinaryIO, progress: Callable[[int], None] | None) -> tuple[Damage, NDArray[np.void]]:
    scanner = Scanner(stream)
    index = bytearray()  # grows in place, so that there is never a second one
    for batch in scanner.batches():
        part = np.empty(len(batch), _INDEX)
        table = batch.table
        part["offset"] = table[Fact.START] + batch.base
        part["size"] = table[Fact.END] - table[Fact.START]
        part["data_type"], part["sender_stamp"] = table[Fact.DATA_TYPE], table[Fact.SENDER_STAMP]
        sent, received, sampled = batch.times
        part["sampled"] = sampled
        part["time"] = np.where(sampled, sampled, np.where(received, received, sent))
        index += part.tobytes()
        if progress is not None:
            progress(scanner.position)
    return scanner.damage, np.frombuffer(index, _INDEX)
