"""Recordings (``.rec``): frames one after the other, without header or footer, read as a stream or by an index.

A recording may be cut, hold garbage, be unsorted or have sample times of zero: what is not a frame is skipped
and noted in a ``Damage``. Memory of a stream is bounded by one chunk and the largest frame, 16 MiB, however large the
file is.
"""

import os
import struct
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv import frame_table, regular_file
from dodo_dsl.opendlv.address import HEADER_BYTES, MAGIC
from dodo_dsl.opendlv.envelope import MICROSECONDS, Envelope
from dodo_dsl.opendlv.frame_table import PADDING, Fact, Table
from dodo_dsl.opendlv.message_columns import Marks, Numbers

MAX_PLACES = 1000


@dataclass
class DamagePlace:
    offset: int
    size: int
    reason: str

    def __str__(self) -> str:
        unit = "byte" if self.size == 1 else "bytes"
        return f"{self.size} {unit} at byte {self.offset}: {self.reason}"


@dataclass
class Damage:
    """All skipped bytes: ``count`` positions with ``size`` bytes in total; ``places`` has the first thousand."""

    places: list[DamagePlace] = field(default_factory=list)
    count: int = 0
    size: int = 0
    _end: int = -1

    def __bool__(self) -> bool:
        return self.count > 0

    def add(self, offset: int, size: int, reason: str) -> None:
        """Note bytes in the order of the file; neighbours are one position with the first reason."""
        self.size += size
        if offset == self._end:
            if self.count <= MAX_PLACES:
                self.places[-1].size += size
        else:
            self.count += 1
            if self.count <= MAX_PLACES:
                self.places.append(DamagePlace(offset, size, reason))
        self._end = offset + size

    def __str__(self) -> str:
        rest = f", and {self.count - 1} more positions, {self.size} bytes together" if self.count > 1 else ""
        return f"skipped {self.places[0]}{rest}"


CHUNK_BYTES = 1 << 20
MAX_FRAMES = 1 << 12

_WORD = struct.Struct("<I")
_CUT, _GARBAGE, _NO_ENVELOPE = "a frame that is cut short", "no frame begins here", "a frame that holds no envelope"


@dataclass(frozen=True)
class Batch:
    """Some frames of a recording: positions in ``table`` count in ``data``, which begins at byte ``base`` of the file.

    ``base`` is -1 where the frames were gathered from several positions.
    """

    data: bytes
    base: int
    table: Table

    def __len__(self) -> int:
        return int(self.table.shape[1])

    @property
    def times(self) -> Numbers:
        """Sent, received and sample times in microseconds since the epoch: (3, frames)."""
        parts = self.table[Fact.SENT_S : Fact.SENDER_STAMP]
        times: Numbers = parts[::2] * MICROSECONDS + parts[1::2]
        return times

    def select(self, rows: Numbers) -> "Batch":
        return Batch(self.data, self.base, self.table[:, rows])

    def frames(self) -> Iterator[bytes]:
        for start, end in self.table[: Fact.END + 1].T.tolist():
            yield self.data[start:end]

    def envelopes(self) -> Iterator[Envelope]:
        columns = (*self.table[Fact.DATA_TYPE : Fact.SENT_S], *self.times, self.table[Fact.SENDER_STAMP])
        for kind, at, end, sent, received, sampled, stamp in zip(*(c.tolist() for c in columns), strict=True):
            yield Envelope(kind, self.data[at:end], sent, received, sampled, stamp)


class Scanner:
    """Reads a stream once, from its position; ``damage`` fills while batches are taken."""

    def __init__(self, stream: BinaryIO) -> None:
        self.damage = Damage()
        self._stream = stream
        self._data, self._base, self._limit = PADDING, 0, 0
        self._at = 0
        self._ended = False
        self._burst = MAX_FRAMES

    @property
    def position(self) -> int:
        return self._base + self._at

    def batches(self) -> Iterator[Batch]:
        while not self._ended:
            self._fill()
            parts = list(self._tables())
            if parts:
                table = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
                yield Batch(self._data, self._base, table)

    def _fill(self) -> None:
        rest, chunk = self._data[self._at : self._limit], self._stream.read(CHUNK_BYTES)
        self._base, self._at = self.position, 0
        self._data, self._limit = b"".join((rest, chunk, PADDING)), len(rest) + len(chunk)
        self._ended = not chunk

    def _tables(self) -> Iterator[Table]:
        """Frames until more bytes are needed; after damage few at a time, as what follows it may be false."""
        while True:
            starts, ends = self._chain()
            if not starts:
                if not self._pass_over():
                    return
                continue
            table = frame_table.read_frames(self._data, starts, ends)
            whole = table.shape[1]
            if whole:
                yield table
            if whole < len(starts):
                self._at, self._burst = starts[whole], 1
                self._skip(_NO_ENVELOPE)
            else:
                self._at, self._burst = ends[-1], min(self._burst * 2, MAX_FRAMES)

    def _chain(self) -> tuple[list[int], list[int]]:
        data, at, last, most = self._data, self._at, self._limit - HEADER_BYTES, self._burst
        starts: list[int] = []
        ends: list[int] = []
        while at <= last and len(starts) < most and data[at] == MAGIC[0]:
            (word,) = _WORD.unpack_from(data, at + 1)
            end = at + HEADER_BYTES + (word >> 8)
            if word & 0xFF != MAGIC[1] or end > self._limit:
                break
            starts.append(at)
            ends.append(end)
            at = end
        return starts, ends

    def _pass_over(self) -> bool:
        """Go to the next header where no whole frame begins; False when more bytes must be seen first."""
        head = self._data[self._at : min(self._at + len(MAGIC), self._limit)]
        if MAGIC.startswith(head):
            if not self._ended or not head:
                return False
            self._skip(_CUT)
        else:
            self._skip(_GARBAGE)
        return True

    def _skip(self, reason: str) -> None:
        found = self._data.find(MAGIC, self._at + 1, self._limit)
        if found < 0:
            half = self._data.endswith(MAGIC[:1], self._at + 1, self._limit) and not self._ended
            found = self._limit - 1 if half else self._limit
        self.damage.add(self._base + self._at, found - self._at, reason)
        self._at = found


BATCH_FRAMES = 1 << 12
BATCH_BYTES = 4 << 20
_NEAR = 1 << 16  # bytes between frames that are read rather than jumped over

_COLUMNS = {"offset": "<i8", "sampled": "<i8", "time": "<i8", "size": "<u4", "data_type": "<i4", "sender_stamp": "<u4"}
_INDEX = np.dtype(list(_COLUMNS.items()))


class RecordingError(ValueError):
    """A file that is not a recording, or that changed while it was read."""

    usage = True


def read_envelopes(path: Path) -> Iterator[Envelope]:
    """The envelopes of a recording in file order; raises OSError for an unreadable file."""
    with regular_file.opened(path) as stream:
        for batch in Scanner(stream).batches():
            yield from batch.envelopes()


class Recording:
    """A recording with an index: a context manager whose rows can be chosen, sorted and read in any order.

    The index takes 36 bytes of memory a message; ``index`` has the columns offset, size (bytes), data_type,
    sender_stamp, sampled and time (microseconds since the epoch), a row for each message in the order of the file.
    ``time`` is the sample time, or if that is zero when the message was received, or else sent.
    """

    def __init__(self, path: Path, most: float = float("inf")) -> None:
        """Read a file once, up to about ``most`` bytes.

        Raises OSError for an unreadable file and for what is none, RecordingError for one without a single message.
        """
        self.path = path
        self._stream: BinaryIO = regular_file.opened(path)
        try:
            self.size = os.fstat(self._stream.fileno()).st_size
            self.damage, self.index = _indexed(path, self._stream, most)
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
        first, behind = 0, 0
        while first < len(wanted):
            most = int(np.searchsorted(ends, behind + BATCH_BYTES, "right"))
            last = max(first + 1, min(first + BATCH_FRAMES, most))
            yield self._gathered(wanted[first:last])
            first, behind = last, int(ends[last - 1])

    def envelopes(self, rows: Numbers | None = None) -> Iterator[Envelope]:
        for batch in self.batches(rows):
            yield from batch.envelopes()

    def envelope(self, row: int) -> Envelope:
        return next(self._gathered(np.array([row])).envelopes())

    def close(self) -> None:
        self._stream.close()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _gathered(self, rows: Numbers) -> Batch:
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


def matching(index: NDArray[np.void], keys: Iterable[tuple[int, int | None]]) -> Marks:
    """Which rows of an index are of these messages, by id and sender stamp (None for any)."""
    marks: Marks = np.zeros(len(index), np.bool_)
    for id_, stamp in keys:
        marks |= (index["data_type"] == id_) & (stamp is None or index["sender_stamp"] == stamp)
    return marks


def _indexed(path: Path, stream: BinaryIO, most: float) -> tuple[Damage, NDArray[np.void]]:
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
        if scanner.position >= most:
            break
    if scanner.position and not index:
        raise RecordingError(f"{path} is not a recording: its {scanner.position} bytes hold no message")
    return scanner.damage, np.frombuffer(index, _INDEX)
