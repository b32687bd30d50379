"""Pictures of shared memory as `opendlv.proxy.ImageReading` messages; only recorders of frames load this."""

import logging
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.video import FORMAT, VideoEncoder, VideoError
from services.base.pictures import png
from services.rec_recorder.source import PictureSource, SourceError

MESSAGE = "opendlv.proxy.ImageReading"

_log = logging.getLogger(__name__)


class Taken(NamedTuple):
    """A picture that is not encoded yet: ``picture`` as ``pixels.view`` has it, times in microseconds."""

    picture: pixels.Picture
    layout: tuple[str, int, int]
    sample_time: int
    sent: int


class RecordedCamera:
    """One memory's pictures, each given to ``store``; ``sender`` distinguishes the memories of a recording.

    ``encoder`` makes a VideoEncoder of a format, width and height. Where pictures are not ``required``, what cannot be
    encoded is logged, and ends them.
    """

    def __init__(
        self,
        source: PictureSource,
        encoder: Callable[[str, int, int], VideoEncoder],
        sender: int,
        store: "Store",
        required: bool = True,
    ) -> None:
        self._source, self._new_encoder, self._store, self._required = source, encoder, store, required
        self._messages, self._sender_stamp = MessageSet.standard(), sender
        self._count, self._is_on = 0, True
        self._layout = ("", 0, 0)
        self._encoder: VideoEncoder | None = None

    def update(self, now: int) -> None:
        """Take a new picture at ``now``, in us, if there is one; raises SourceError and VideoError."""
        try:
            if self._is_on and (taken := self._source.take(now)):
                layout = self._source.spec.layout(len(taken[0]))
                picture = pixels.view(taken[0], *layout)
                self._store(self, Taken(picture, layout, taken[1], time.time_ns() // 1000))
        except (SourceError, VideoError) as error:
            if self._required:
                raise
            _log.warning("no pictures are recorded: %s", error)
            self._is_on = False
            self.close()

    def envelope(self, taken: Taken) -> Envelope:
        """The message of a picture, which follows the one before in the video; raises VideoError."""
        if self._encoder is None or taken.layout != self._layout:
            self._encoder, self._layout = self._new_encoder(*taken.layout), taken.layout
        _, width, height = self._layout
        data, number = self._encoder.encode(taken.picture), self._count
        fields = {"format": FORMAT, "width": width, "height": height, "data": data, "sampleId": number}
        self._count += 1
        payload = self._messages.encode(self._messages.type(MESSAGE)(**fields))
        return Envelope(
            self._messages.id(MESSAGE), payload, taken.sent, taken.sent, taken.sample_time, self._sender_stamp
        )

    def close(self) -> None:
        self._source.close()


Store = Callable[[RecordedCamera, Taken], None]


class Later:
    """Pictures that are encoded when they have more than ``max_size`` bytes, or at the end, if ``is_wanted`` then.

    So those of a short test that passes cost hardly any time.
    """

    def __init__(self, write: Callable[[Envelope], None], is_wanted: Callable[[], bool], max_size: int) -> None:
        self._write, self._is_wanted, self._max_size = write, is_wanted, max_size
        self._waiting: deque[tuple[RecordedCamera, Taken]] = deque()
        self._size = 0

    def add(self, camera: RecordedCamera, taken: Taken) -> None:
        """Keep a picture, in the room that i420 takes; raises VideoError, also for an earlier picture."""
        kind, width, height = taken.layout
        try:
            picture = pixels.converted(taken.picture, kind, "i420")
        except pixels.PixelError as error:
            raise VideoError(str(error)) from None
        self._waiting.append((camera, taken._replace(picture=picture, layout=("i420", width, height))))
        self._size += picture.nbytes
        while self._size > self._max_size:
            self._encode()

    def close(self) -> None:
        try:
            while self._waiting and self._is_wanted():
                self._encode()
        except VideoError as error:
            _log.warning("not all pictures are recorded: %s", error)
        self._waiting.clear()

    def _encode(self) -> None:
        camera, taken = self._waiting.popleft()
        self._size -= taken.picture.nbytes
        self._write(camera.envelope(taken))


class Snapshot:
    """The first picture of ``source`` from a test's begin on, as a new PNG file; what fails is only logged."""

    def __init__(self, source: PictureSource, path: Path) -> None:
        self._source, self._path = source, path
        self._has_begun = self._is_taken = False

    def begin(self) -> None:
        """The test begins: what was there before is not wanted."""
        self._source.skip()
        self._has_begun = True

    def update(self, now: int) -> None:
        taken = None if self._is_taken else self._source.take(now)
        if taken is None or not self._has_begun:
            return
        self._is_taken = True
        try:
            layout = self._source.spec.layout(len(taken[0]))
            picture = pixels.converted(pixels.view(taken[0], *layout), layout[0], "bgr")
            with self._path.open("xb") as file:
                file.write(png(picture))
        except (ValueError, OSError) as error:
            _log.warning("no snapshot was taken: %s", error)

    def close(self) -> None:
        self._source.close()
