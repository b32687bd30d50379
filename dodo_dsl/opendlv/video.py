"""Compressed camera frames to images, and images to packets of h264, through PyAV.

Frames are those of recordings (``opendlv.proxy.ImageReading``), images those of a shared memory.
"""

import shlex
import sys
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.picture_size import MAX_PIXELS, too_large

CODECS = {"h264": "h264", "H264": "h264", "VP80": "vp8", "VP90": "vp9", "mjpg": "mjpeg", "MJPG": "mjpeg"}
_START = b"\x00\x00\x01"
_IDR = 5
_AV_NAMES = {"argb": "bgra", "i420": "yuv420p", "bgr": "bgr24", "rgb": "rgb24"}


class VideoError(ValueError):
    """Frames that cannot be decoded here: an unknown codec, or PyAV is not installed."""


def refuse_large(width: int, height: int) -> None:
    if problem := too_large(width, height):
        raise VideoError(f"frames cannot be decoded: {problem}")


class DecodedFrame:
    """A decoded frame of ``width`` by ``height`` pixels."""

    def __init__(self, frame: Any) -> None:
        self._frame = frame
        self.width: int = frame.width
        self.height: int = frame.height

    def pixels(self, kind: str) -> NDArray[np.uint8]:
        """The image, shaped as ``pixels.view`` has it."""
        return np.asarray(self._frame.to_ndarray(format=_AV_NAMES[kind]), np.uint8)


class VideoDecoder:
    """Decodes the packets of one camera in their order; raises VideoError for an unknown format.

    Decoding begins at the first key frame; packets before it, and such that are damaged, give no frame. Nor do those
    of images with more than MAX_PIXELS, whatever size a message declares: they are not decoded at all.
    """

    def __init__(self, format_: str) -> None:
        if format_ not in CODECS:
            known = ", ".join(CODECS)
            raise VideoError(f"frames of format '{format_:.40}' cannot be decoded, expected one of {known}")
        self._av = pyav("decoded")
        self._is_h264 = CODECS[format_] == "h264"
        self._codec: Any = self._av.CodecContext.create(CODECS[format_], "r")
        self._codec.options = {"max_pixels": str(MAX_PIXELS)}
        self._codec.thread_count = 1
        self._codec.thread_type = "SLICE"  # a frame comes with its packet, not some packets later
        self._codec.flags |= self._av.codec.context.Flags.low_delay
        self._begun = False
        self.early = 0
        """Packets that came before the first key frame."""

    def decode(self, packet: bytes) -> DecodedFrame | None:
        if not packet or not (self._begun or not self._is_h264 or has_key_frame(packet)):
            self.early += bool(packet)
            return None
        try:
            frames = self._codec.decode(self._av.Packet(packet))
        except self._av.FFmpegError:
            return None
        self._begun = self._begun or bool(frames)
        return DecodedFrame(frames[-1]) if frames else None


def has_key_frame(packet: bytes) -> bool:
    """Whether an h264 packet holds a slice of an image that stands alone (ITU-T H.264, table 7-1, type 5)."""
    at = packet.find(_START)
    while 0 <= at < len(packet) - len(_START):
        if packet[at + len(_START)] & 0x1F == _IDR:
            return True
        at = packet.find(_START, at + len(_START))
    return False


def pyav(purpose: str) -> Any:
    try:
        import av
    except ImportError as error:
        way = f"{shlex.quote(sys.executable)} -m pip install av; DoDo's image 'vision' has it"
        raise VideoError(f"frames cannot be {purpose}: the package 'av' cannot be loaded ({error}): {way}") from None
    return av


FORMAT = "h264"
_MICROSECOND = Fraction(1, 1_000_000)
_LOSSLESS = {"argb": "bgr0", "bgr": "bgr24", "rgb": "rgb24", "i420": "yuv420p"}
_PLANAR = "yuv420p"


class VideoEncoder:
    """Encodes the images of one camera, ``kind`` being one of the formats of ``pixels``.

    Every ``key_interval``-th image stands alone and brings what a decoder needs. ``quality`` is x264's constant rate
    factor, 0 (best) to 51; lossy packets are of the baseline profile, which all decoders know. ``lossless`` packets
    give back the same bytes (alpha aside) and need a decoder of the High 4:4:4 profile, such as FFmpeg. ``fast`` ones
    take less time and more room.
    One thread, no look-ahead: a packet comes with its image, the same for the same images.
    Raises VideoError for sizes that h264 cannot have, and where PyAV is not installed.
    """

    def __init__(
        self,
        kind: str,
        width: int,
        height: int,
        key_interval: int = 10,
        quality: int = 23,
        lossless: bool = False,
        fast: bool = False,
    ) -> None:
        if width % 2 or height % 2 or min(width, height) < 2:
            raise VideoError(f"h264 needs an even width and height, not {width} x {height}")
        self._av = pyav("encoded")
        self._kind, self._width, self._height = kind, width, height
        self._pixels = _LOSSLESS[kind] if lossless else _PLANAR
        self._next = 0
        self._codec: Any = self._av.CodecContext.create("libx264" if self._pixels == _PLANAR else "libx264rgb", "w")
        self._codec.width, self._codec.height, self._codec.pix_fmt = width, height, self._pixels
        self._codec.time_base, self._codec.framerate = _MICROSECOND, Fraction(10)
        self._codec.gop_size, self._codec.max_b_frames, self._codec.thread_count = key_interval, 0, 1
        rate = {"qp": "0"} if lossless else {"profile": "baseline", "crf": str(quality)}
        rate["preset"] = "ultrafast" if lossless or fast else "veryfast"
        self._codec.options = {"tune": "zerolatency", "x264-params": "scenecut=0", **rate}
        try:
            self._codec.open()
        except self._av.FFmpegError as error:
            raise VideoError(f"images of {width} x {height} pixels cannot be encoded: {error}") from None

    def encode(self, picture: NDArray[np.uint8]) -> bytes:
        """The packet of an image, shaped as ``pixels.view`` has it; raises VideoError."""
        frame = self._av.VideoFrame.from_ndarray(picture, format=_AV_NAMES[self._kind]).reformat(format=self._pixels)
        frame.pts = self._next * 100_000
        self._next += 1
        try:
            return b"".join(bytes(packet) for packet in self._codec.encode(frame))
        except self._av.FFmpegError as error:
            raise VideoError(f"an image cannot be encoded: {error}") from None
