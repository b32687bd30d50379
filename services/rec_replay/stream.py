"""The entries of a part in order, read in blocks, pictures decoded ahead."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.opendlv.video.decoder import VideoError
from services.rec_replay.pictures import Decoder, RecordedPicture, lead_in, pixels
from services.rec_replay.selection import Part

READ_AHEAD = 256


class RecordedEntry(NamedTuple):
    """An entry to play: ``picture`` if it is shown and could be decoded, ``is_sent`` if it goes to the bus."""

    envelope: Envelope
    is_sent: bool
    picture: RecordedPicture | None


class EntryStream:
    """Entries from a position on. The one after the last that was taken is read, and decoded, by `prepare`."""

    def __init__(self, recording: Recording, part: Part) -> None:
        self.decoder = Decoder()
        self._recording, self._part = recording, part
        self.shown = part.shown
        """Which entries are pictures for the memory."""
        self._images = np.flatnonzero(part.shown)
        self._entries = self._from(0)
        self._ahead: RecordedEntry | None = None

    def seek(self, position: int) -> None:
        """Go on with another entry; what its picture needs is decoded first."""
        self._entries, self._ahead = self._from(position), None
        self.decoder.restart()
        before = int(np.searchsorted(self._images, position))
        if before and before < len(self._images):
            undecoded = self.decoder.undecoded
            for envelope in lead_in(self._recording, self._part.rows[self._images], before):
                self._decoded(envelope)
            self.decoder.undecoded = undecoded

    def prepare(self) -> None:
        """Read the next entry and decode its picture, before it is due."""
        if self._ahead is None:
            self._ahead = next(self._entries, None)

    def take(self) -> RecordedEntry:
        """The next entry; raises StopIteration behind the last."""
        entry = self._ahead or next(self._entries)
        self._ahead = None
        return entry

    def _from(self, position: int) -> Iterator[RecordedEntry]:
        part = self._part
        for first in range(position, len(part), READ_AHEAD):
            last = first + READ_AHEAD
            marks = zip(part.sent[first:last].tolist(), part.shown[first:last].tolist(), strict=True)
            envelopes = self._recording.envelopes(part.rows[first:last])
            for envelope, (sent, shown) in zip(envelopes, marks, strict=True):
                yield RecordedEntry(envelope, sent, self._decoded(envelope) if shown else None)

    def _decoded(self, envelope: Envelope) -> RecordedPicture | None:
        try:
            frame = self.decoder.frame(envelope)
        except VideoError:
            self.decoder.undecoded += 1
            return None
        return pixels(frame) if frame is not None else None
