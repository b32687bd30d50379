"""The entries of a part in order, read in blocks; pictures decoded ahead and put into shared memory."""

import logging
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame, VideoDecoder, VideoError, has_key_frame, refuse_large
from services.base.pictures import Memories, show
from services.rec_replay.selection import Part

FARTHEST = 3000
"""Pictures that are searched for a key frame before a place in the recording."""

_log = logging.getLogger(__name__)


class RecordedPicture(NamedTuple):
    """A picture as B, G, R, A (height, width, 4) and as I420 (height * 3 / 2, width; None for odd sizes)."""

    argb: NDArray[np.uint8]
    i420: NDArray[np.uint8] | None


class Decoder:
    """Decodes one camera's ImageReading messages in their order; `undecoded` counts those that gave no picture.

    ``early`` are those of them that came before the first key frame.
    """

    def __init__(self) -> None:
        self.undecoded = self.early = 0
        self.fault: VideoError | None = None
        self._messages = MessageSet.standard()
        self._format = ""
        self._codec: VideoDecoder | None = None

    def restart(self) -> None:
        """The next picture does not follow the last one."""
        self._codec = None

    def frame(self, envelope: Envelope) -> DecodedFrame | None:
        """The picture of a message; None, and the ``fault``, for an unknown format or too large a size."""
        frame = None
        try:
            frame = self._decoded(self._image(envelope))
        except VideoError as error:
            self.fault = self.fault or error
        self.undecoded += frame is None
        return frame

    def _decoded(self, image: Any) -> DecodedFrame | None:
        if image is None:
            return None
        refuse_large(image.width, image.height)
        if self._codec is None or image.format != self._format:
            self._codec, self._format = VideoDecoder(image.format), image.format
        before = self._codec.early
        frame = self._codec.decode(image.data)
        self.early += self._codec.early - before
        return frame

    def is_key_frame(self, envelope: Envelope) -> bool:
        """Whether decoding can begin here."""
        image = self._image(envelope)
        return image is not None and has_key_frame(image.data)

    def _image(self, envelope: Envelope) -> Any:
        """The decoded message; set 0.9 has the same fields under other names."""
        try:
            return self._messages.decode(IMAGE, envelope.payload)
        except MessageError:
            return None


def pixels(frame: DecodedFrame) -> RecordedPicture:
    """The picture in both formats of a camera."""
    even = frame.width % 2 == 0 and frame.height % 2 == 0
    return RecordedPicture(frame.pixels("argb"), frame.pixels("i420") if even else None)


def first_frame(recording: Recording, rows: Numbers) -> DecodedFrame:
    """The first picture of the rows that can be decoded; raises VideoError if none can."""
    decoder = Decoder()
    for envelope in recording.envelopes(rows):
        frame = decoder.frame(envelope)
        if frame is not None:
            return frame
    if decoder.fault is not None:
        raise decoder.fault
    why = ": there is no key frame among them" if decoder.early == len(rows) else ""
    raise VideoError(f"none of the {len(rows)} pictures in {recording.path} can be decoded{why}")


def lead_in(recording: Recording, rows: Numbers, before: int) -> Iterator[Envelope]:
    """The messages to decode before row number ``before`` of the rows: from the last key frame."""
    decoder, first = Decoder(), max(0, before - FARTHEST)
    for number in range(before, first - 1, -1):
        if number < len(rows) and decoder.is_key_frame(recording.envelope(int(rows[number]))):
            yield from recording.envelopes(rows[number:before])
            return
    yield from recording.envelopes(rows[first:before])


class PictureMemories:
    """Memories for pictures. A picture of another size than the first is skipped, and counted in ``misfits``."""

    def __init__(self, memories: Memories) -> None:
        """Each memory with the format of its pictures, that in argb first."""
        self.shown = self.misfits = 0
        self._memories = memories

    def show(self, picture: RecordedPicture, sample_time: int) -> bool:
        """Publish a picture, if it has the size; raises SharedMemoryError when a reader keeps the lock."""
        if picture.argb.nbytes != self._memories[0][0].size:
            if not self.misfits:
                _log.warning("skipped the picture of %d us, which has another size than the first", sample_time)
            self.misfits += 1
            return False
        show(self._memories, *picture, sample_time)
        self.shown += 1
        return True


READ_AHEAD = 256


Entry = tuple[Envelope, bytes, bool, RecordedPicture | None]
"""A message, its frame as recorded, whether it is sent, and its picture if it is shown and could be decoded."""


class EntryStream:
    """Entries from a position on. The one after the last that was taken is read, and decoded, by `prepare`."""

    def __init__(self, recording: Recording, part: Part) -> None:
        self.decoder = Decoder()
        self._recording, self._part = recording, part
        self.shown = part.shown
        """Which entries are pictures for the memory."""
        self.times: Numbers = recording.index["time"][part.rows]
        """The sample times of entries, in us."""
        self._images = np.flatnonzero(part.shown)
        self._entries = self._from(0)
        self._ahead: Entry | None = None

    def seek(self, position: int) -> None:
        """Go on with another entry; what its picture needs is decoded first."""
        self._entries, self._ahead = self._from(position), None
        self.decoder.restart()
        before = int(np.searchsorted(self._images, position))
        if before and before < len(self._images):
            undecoded, early = self.decoder.undecoded, self.decoder.early
            for envelope in lead_in(self._recording, self._part.rows[self._images], before):
                self._decoded(envelope)
            self.decoder.undecoded, self.decoder.early = undecoded, early

    def prepare(self) -> None:
        """Read the next entry and decode its picture, before it is due."""
        if self._ahead is None:
            self._ahead = next(self._entries, None)

    def take(self) -> Entry:
        """The next entry; raises StopIteration behind the last."""
        entry = self._ahead or next(self._entries)
        self._ahead = None
        return entry

    def _from(self, position: int) -> Iterator[Entry]:
        part = self._part
        for first in range(position, len(part), READ_AHEAD):
            last = first + READ_AHEAD
            marks = zip(part.sent[first:last].tolist(), part.shown[first:last].tolist(), strict=True)
            for batch in self._recording.batches(part.rows[first:last]):
                batch.table[[Fact.RECEIVED_S, Fact.RECEIVED_US]] = 0  # it has not been received yet
                for envelope, frame, (sent, shown) in zip(batch.envelopes(), batch.frames(), marks, strict=False):
                    yield envelope, frame, sent, self._decoded(envelope) if shown else None

    def _decoded(self, envelope: Envelope) -> RecordedPicture | None:
        frame = self.decoder.frame(envelope)
        return pixels(frame) if frame is not None else None
