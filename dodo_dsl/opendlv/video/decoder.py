"""Compressed camera frames of recordings (``opendlv.proxy.ImageReading``) back to pictures, through PyAV."""

import shlex
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.video.picture_size import MAX_PIXELS, too_large

CODECS = {"h264": "h264", "H264": "h264", "VP80": "vp8", "VP90": "vp9", "mjpg": "mjpeg", "MJPG": "mjpeg"}
_START = b"\x00\x00\x01"
_IDR = 5
_SHOWN = 40
_AV_NAMES = {"argb": "bgra", "i420": "yuv420p", "bgr": "bgr24"}


class VideoError(ValueError):
    """Frames that cannot be decoded here: an unknown codec, or PyAV is not installed."""


def refuse_large(width: int, height: int) -> None:
    """Raises VideoError for frames of a size that is not decoded."""
    if problem := too_large(width, height):
        raise VideoError(f"frames cannot be decoded: {problem}")


class DecodedFrame:
    """A decoded frame of ``width`` by ``height`` pixels."""

    def __init__(self, frame: Any) -> None:
        self._frame = frame
        self.width: int = frame.width
        self.height: int = frame.height

    def pixels(self, kind: str) -> NDArray[np.uint8]:
        """The picture as in OpenDLV's memory: ``argb`` (height, width, 4: B, G, R, A), ``bgr`` (height, width, 3)
        or ``i420`` (height * 3 / 2, width: the planes Y, U, V).
        """
        array: NDArray[np.uint8] = self._frame.to_ndarray(format=_AV_NAMES[kind])
        return array


class VideoDecoder:
    """Decodes the packets of one camera in their order; raises VideoError for an unknown format.

    Decoding begins at the first key frame; packets before it, and such that are damaged, give no frame. Nor do those
    of pictures with more than MAX_PIXELS, whatever a message says of their size: they are not decoded at all.
    """

    def __init__(self, format_: str) -> None:
        if format_ not in CODECS:
            raise VideoError(
                f"frames of format '{format_[:_SHOWN]}' cannot be decoded, expected one of {', '.join(CODECS)}"
            )
        self._av = pyav("decoded")
        self._is_h264 = CODECS[format_] == "h264"
        self._codec: Any = self._av.CodecContext.create(CODECS[format_], "r")
        self._codec.options = {"max_pixels": str(MAX_PIXELS)}
        self._codec.thread_count = 1
        self._codec.thread_type = "SLICE"  # a frame comes with its packet, not some packets later
        self._codec.flags |= self._av.codec.context.Flags.low_delay
        self._begun = False

    def decode(self, packet: bytes) -> DecodedFrame | None:
        """The frame of a packet, or None."""
        if not packet or not (self._begun or self._begins(packet)):
            return None
        try:
            frames = self._codec.decode(self._av.Packet(packet))
        except self._av.FFmpegError:
            return None
        self._begun = self._begun or bool(frames)
        return DecodedFrame(frames[-1]) if frames else None

    def _begins(self, packet: bytes) -> bool:
        return not self._is_h264 or has_key_frame(packet)


def has_key_frame(packet: bytes) -> bool:
    """Whether an h264 packet holds a slice of a picture that stands alone (ITU-T H.264, table 7-1, type 5)."""
    at = packet.find(_START)
    while 0 <= at < len(packet) - len(_START):
        if packet[at + len(_START)] & 0x1F == _IDR:
            return True
        at = packet.find(_START, at + len(_START))
    return False


def pyav(purpose: str) -> Any:
    """PyAV; raises VideoError where it cannot be loaded."""
    try:
        import av
    except ImportError as error:
        way = f"{shlex.quote(sys.executable)} -m pip install av; DoDo's image 'vision' has it"
        raise VideoError(f"frames cannot be {purpose}: the package 'av' cannot be loaded ({error}): {way}") from None
    return av
