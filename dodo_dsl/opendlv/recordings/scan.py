"""A recording read as a stream, in batches of frames; what is not a frame is skipped and noted.

Memory is bounded by one chunk and the largest frame, 16 MiB, however large the file is.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from dodo_dsl.opendlv.bus.envelope import HEADER_BYTES, MAGIC, MICROSECONDS, Envelope
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings import frame_table
from dodo_dsl.opendlv.recordings.damage import Damage
from dodo_dsl.opendlv.recordings.frame_table import PADDING, Fact, Table

CHUNK_BYTES = 1 << 20
MAX_FRAMES = 1 << 12

_WORD = struct.Struct("<I")
_CUT, _GARBAGE, _NO_ENVELOPE = "a frame that is cut short", "no frame begins here", "a frame that holds no envelope"


@dataclass(frozen=True)
class Batch:
    """Some frames of a recording: positions in ``table`` count in ``data``, which begins at byte ``base`` of the file.

    ``base`` is -1 where the frames were gathered from several places.
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
        """Some rows, in the order given."""
        return Batch(self.data, self.base, self.table[:, rows])

    def frames(self) -> Iterator[bytes]:
        """The frames, header included."""
        for start, end in self.table[: Fact.END + 1].T.tolist():
            yield self.data[start:end]

    def envelopes(self) -> Iterator[Envelope]:
        """The envelopes in the order of the rows."""
        table = self.table
        columns = (*table[Fact.DATA_TYPE : Fact.SENT_S], *self.times, table[Fact.SENDER_STAMP])
        data = self.data
        for kind, at, end, sent, received, sampled, stamp in zip(*(c.tolist() for c in columns), strict=True):
            yield Envelope(kind, data[at:end], sent, received, sampled, stamp)


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
        """How many bytes are behind."""
        return self._base + self._at

    def batches(self) -> Iterator[Batch]:
        """Batches of one frame or more, in the order of the file."""
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
        """Begins and ends of whole frames, one behind the other."""
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
