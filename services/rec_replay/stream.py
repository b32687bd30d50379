"""The entries of a part in order, read in blocks; pictures decoded ahead."""

from collections.abc import Iterator

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.frame_decoder import FrameDecoder
from dodo_dsl.opendlv.frame_table import Fact
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.pixels import Picture
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame, VideoError
from services.rec_replay.selection import Part

Pictures = tuple[Picture, Picture | None]
"""A frame as B, G, R, A (height, width, 4) and as I420 (height * 3 / 2, width; None for odd sizes)."""


def pictures(frame: DecodedFrame) -> Pictures:
    even = frame.width % 2 == 0 and frame.height % 2 == 0
    return frame.pixels("argb"), frame.pixels("i420") if even else None


def first_frame(recording: Recording, rows: Numbers) -> DecodedFrame:
    """The first picture of the rows that can be decoded; raises VideoError if none can."""
    decoder, fault = FrameDecoder(), None
    for envelope in recording.envelopes(rows):
        try:
            if (frame := decoder.decode(envelope)) is not None:
                return frame
        except VideoError as error:
            fault = fault or error
    if fault is not None:
        raise fault
    why = ": there is no key frame among them" if decoder.early == len(rows) else ""
    raise VideoError(f"none of the {len(rows)} pictures in {recording.path} can be decoded{why}")


READ_AHEAD = 256

Entry = tuple[Envelope, bytes, bool, Pictures | None]
"""A message, its frame as recorded, whether it is sent, and its picture if it is shown and could be decoded."""


class EntryStream:
    """The entries of a part. The one after the last that was taken is read, and decoded, by `prepare`."""

    def __init__(self, recording: Recording, part: Part) -> None:
        self._recording, self._part = recording, part
        self.shown = part.shown
        """Which entries are pictures for the memory."""
        self.times: Numbers = recording.index["time"][part.rows]
        """The sample times of entries, in us."""
        self.rewind()

    def rewind(self) -> None:
        self.decoder = FrameDecoder()
        self._entries = self._all()
        self._ahead: Entry | None = None

    def prepare(self) -> None:
        """Read the next entry and decode its picture, before it is due."""
        if self._ahead is None:
            self._ahead = next(self._entries, None)

    def take(self) -> Entry:
        """The next entry; raises StopIteration behind the last."""
        entry = self._ahead or next(self._entries)
        self._ahead = None
        return entry

    def _all(self) -> Iterator[Entry]:
        part = self._part
        for first in range(0, len(part), READ_AHEAD):
            last = first + READ_AHEAD
            marks = zip(part.sent[first:last].tolist(), part.shown[first:last].tolist(), strict=True)
            for batch in self._recording.batches(part.rows[first:last]):
                batch.table[[Fact.RECEIVED_S, Fact.RECEIVED_US]] = 0  # it has not been received yet
                for envelope, frame, (sent, shown) in zip(batch.envelopes(), batch.frames(), marks, strict=False):
                    yield envelope, frame, sent, self._decoded(envelope) if shown else None

    def _decoded(self, envelope: Envelope) -> Pictures | None:
        try:
            frame = self.decoder.decode(envelope)
        except VideoError:
            return None
        return pictures(frame) if frame is not None else None
