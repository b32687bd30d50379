"""Pictures of shared memory as `opendlv.proxy.ImageReading` messages; only recorders of frames load this."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.memory import pixels
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.video.decoder import VideoError
from dodo_dsl.opendlv.video.encoder import FORMAT, VideoEncoder
from services.rec_recorder.source import Source, SourceError

MESSAGE = "opendlv.proxy.ImageReading"

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Quality:
    """How pictures are encoded, as VideoEncoder has it."""

    key_interval: int
    quality: int
    lossless: bool
    fast: bool = False


class RecordedCamera:
    """One memory's pictures, encoded; `sender_stamp` tells the memories of a recording apart."""

    def __init__(self, source: Source, quality: Quality, messages: MessageSet, sender_stamp: int) -> None:
        self._source, self._quality = source, quality
        self._messages, self._sender_stamp = messages, sender_stamp
        self._count = 0
        self._layout = ("", 0, 0)
        self._encoder: VideoEncoder | None = None

    def envelope(self, now: int) -> Envelope | None:
        """The message of a new picture, if there is one; raises SourceError or VideoError when that fails."""
        taken = self._source.take(now)
        if taken is None:
            return None
        data, sample_time = taken
        layout = self._source.spec.layout(len(data))
        if self._encoder is None or layout != self._layout:
            quality = self._quality
            self._encoder = VideoEncoder(*layout, quality.key_interval, quality.quality, quality.lossless, quality.fast)
            self._layout = layout
        message = self._message(self._encoder.encode(pixels.view(data, *layout)))
        sent = time.time_ns() // 1000
        payload = self._messages.encode(message)
        return Envelope(self._messages.id(MESSAGE), payload, sent, sent, sample_time, self._sender_stamp)

    def restart(self) -> None:
        """Begin with a key frame at the next picture, as those before are not in the recording."""
        self._source.skip()
        self._encoder = None

    def close(self) -> None:
        """Detach from the memory."""
        self._source.close()

    def _message(self, packet: bytes) -> Any:
        self._count += 1
        _, width, height = self._layout
        fields = {"format": FORMAT, "width": width, "height": height, "data": packet, "sampleId": self._count - 1}
        return self._messages.type(MESSAGE)(**fields)


class Cameras:
    """All memories that are recorded: each picture goes to `write` while `is_on`.

    Where pictures are not ``required``, a camera whose pictures cannot be encoded is logged and left out.
    """

    def __init__(
        self,
        cameras: Sequence[RecordedCamera],
        write: Callable[[Envelope], None],
        is_on: Callable[[], bool],
        required: bool = True,
    ) -> None:
        self._cameras, self._write, self._is_on, self._required = list(cameras), write, is_on, required
        self._was_on = True

    def update(self, now: int) -> None:
        """Take what is there at `now`, microseconds."""
        if not self._is_on():
            self._was_on = False
            return
        for camera in tuple(self._cameras):
            if not self._was_on:
                camera.restart()
            envelope = self._taken(camera, now)
            if envelope is not None:
                self._write(envelope)
        self._was_on = True

    def _taken(self, camera: RecordedCamera, now: int) -> Envelope | None:
        try:
            return camera.envelope(now)
        except (SourceError, VideoError) as error:
            if self._required:
                raise
            _log.warning("no pictures are recorded: %s", error)
            self._cameras.remove(camera)
            camera.close()
            return None

    def close(self) -> None:
        """Detach from all memories."""
        for camera in self._cameras:
            camera.close()
