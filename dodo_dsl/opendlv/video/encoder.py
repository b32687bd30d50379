"""Pictures of a shared memory as packets of h264, as OpenDLV's recordings hold them, through PyAV."""

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.opendlv.video.decoder import VideoError, pyav

FORMAT = "h264"
_MICROSECOND = Fraction(1, 1_000_000)
_AV_NAMES = {"argb": "bgr0", "bgr": "bgr24", "i420": "yuv420p"}
_PLANAR = "yuv420p"


class VideoEncoder:
    """Encodes the pictures of one camera, ``kind`` being ``argb``, ``bgr`` or ``i420`` as ``pixels`` has them.

    Every ``key_interval``-th picture stands alone and brings what a decoder needs. ``quality`` is x264's constant rate
    factor, 0 (best) to 51; lossy packets are of the baseline profile, which all decoders know. ``lossless`` packets
    give back the same bytes (alpha aside) and need a decoder of the High 4:4:4 profile, such as FFmpeg. ``fast`` ones
    take less time and more room.
    One thread, no look-ahead: a packet comes with its picture, the same for the same pictures.
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
        self._pixels = _AV_NAMES[kind] if lossless else _PLANAR
        self._next = 0
        self._codec: Any = self._av.CodecContext.create("libx264rgb" if self._is_rgb else "libx264", "w")
        self._codec.width, self._codec.height, self._codec.pix_fmt = width, height, self._pixels
        self._codec.time_base, self._codec.framerate = _MICROSECOND, Fraction(10)
        self._codec.gop_size, self._codec.max_b_frames, self._codec.thread_count = key_interval, 0, 1
        self._codec.options = {"tune": "zerolatency", "x264-params": "scenecut=0", **_rate(quality, lossless, fast)}
        try:
            self._codec.open()
        except self._av.FFmpegError as error:
            raise VideoError(f"pictures of {width} x {height} pixels cannot be encoded: {error}") from None

    @property
    def _is_rgb(self) -> bool:
        return self._pixels != _PLANAR

    def encode(self, picture: NDArray[np.uint8]) -> bytes:
        """The packet of a picture, shaped as ``pixels.view`` has it; raises VideoError."""
        frame = self._frame(picture)
        frame.pts = self._next * 100_000
        self._next += 1
        try:
            return b"".join(bytes(packet) for packet in self._codec.encode(frame))
        except self._av.FFmpegError as error:
            raise VideoError(f"a picture cannot be encoded: {error}") from None

    def _frame(self, picture: NDArray[np.uint8]) -> Any:
        if self._kind == "i420":
            return self._av.VideoFrame.from_ndarray(picture, format=_PLANAR)
        frame = self._av.VideoFrame(self._width, self._height, _AV_NAMES[self._kind])
        plane = frame.planes[0]
        rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
        rows[: self._height, : picture[0].nbytes] = picture.reshape(self._height, -1)
        return frame if self._is_rgb else frame.reformat(format=_PLANAR)


def _rate(quality: int, lossless: bool, fast: bool) -> dict[str, str]:
    if lossless:
        return {"preset": "ultrafast", "qp": "0"}
    return {"preset": "ultrafast" if fast else "veryfast", "profile": "baseline", "crf": str(quality)}
