"""The frames of a camera as an MP4, each shown at its time, or as images, a file each.

In the MP4 packets of H.264 are as they were recorded, others encoded again.
"""

import io
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import CODECS, FORMAT, VideoEncoder, VideoError, has_key_frame, refuse_large
from dodo_dsl.rec.frames import FramesError, decoded, packets, write_picture

MOST_GAP = 1_800_000_000
"""us between two frames; an MP4 counts the time of a frame in 32 bits."""
DEFAULT_LASTING = 100_000
"""us that a single frame is shown."""


@dataclass
class VideoTimes:
    """When frames are shown, in us since the first, which was taken at ``begin``.

    Each is at least 1 us and at most MOST_GAP after the one before; ``late`` of them are so, and ``gaps`` shortened.
    """

    begin: int = 0
    late: int = 0
    gaps: int = 0
    _last: int | None = None
    _shown: int = 0

    def shown(self, time: int) -> int:
        """When the next frame is shown, which was taken at ``time``."""
        if self._last is None:
            self.begin = self._last = time
        else:
            rising = max(time, self._last + 1)
            self.late += rising != time
            self.gaps += rising - self._last > MOST_GAP
            self._shown += min(rising - self._last, MOST_GAP)
            self._last = rising
        return self._shown


def timed(
    found: Iterator[tuple[int, bytes]], taken: Numbers, times: VideoTimes
) -> Iterator[tuple[int, bytes, int, int]]:
    """A packet's number, the packet, when it is shown and for how long, in us; the last as long as the one before."""
    waiting, lasting = None, DEFAULT_LASTING
    for number, data in found:
        shown = times.shown(int(taken[number]))
        if waiting is not None:
            lasting = shown - waiting[2]
            yield *waiting, lasting
        waiting = number, data, shown
    if waiting is not None:
        yield *waiting, lasting


_MICROSECOND = Fraction(1, 1_000_000)
_SHOWN = 40
_CHOOSE = ", and both do not fit into one video; choose a part with --start and --end"


@dataclass(frozen=True)
class VideoFile:
    """What became of the packets: ``frames`` of ``size`` in the file, ``late`` of them later than they were taken,
    ``gaps`` shortened, and whether they were ``encoded`` again.
    """

    frames: int
    size: tuple[int, int]
    late: int
    gaps: int
    encoded: bool


def write_video(
    recording: Recording,
    images: Numbers,
    place: Path,
    progress: Callable[[int], None],
    problem: Callable[[str], None],
) -> VideoFile:
    """Write the image messages of one camera, from the first key frame on, with their sample times.

    ``progress`` gets the number of packets done, ``problem`` a sentence about what cannot be decoded at all. Raises
    FramesError if nothing can be written, or frames do not fit into one file, and OSError.
    """
    format_ = next((packet.format for packet in packets(recording, images) if packet.format), "")
    is_h264 = CODECS.get(format_) == FORMAT
    found = _recorded(recording, images) if is_h264 else _encoded(recording, images, problem)
    times, mp4, frames = VideoTimes(), None, 0
    with _readable_errors(recording.path), ExitStack() as files:
        for number, data, shown, lasting in timed(found, recording.index["time"][images], times):
            mp4 = mp4 or _Mp4(files, place, data, times.begin)
            mp4.add(data, shown, lasting)
            frames += 1
            progress(number + 1)
    if mp4 is None:
        raise FramesError(f"no frame of {recording.path} can be decoded")
    return VideoFile(frames, mp4.size, times.late, times.gaps, not is_h264)


@contextmanager
def _readable_errors(path: Path) -> Iterator[None]:
    """Errors of PyAV and of frames as FramesError, and as an OSError without a name where the disk is to blame."""
    import av

    try:
        yield
    except av.FFmpegError as error:
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror) from None
        raise FramesError(f"{path}: frames cannot be put into a video: {error}") from None
    except VideoError as error:
        raise FramesError(f"{path}: {error}") from None


def _recorded(recording: Recording, images: Numbers) -> Iterator[tuple[int, bytes]]:
    """The packets of H.264 from the first key frame on, each with its number; raises VideoError for other ones."""
    begun = False
    for number, packet in enumerate(packets(recording, images)):
        if packet.format and CODECS.get(packet.format) != FORMAT:
            raise VideoError(f"a frame of format '{packet.format[:_SHOWN]}' follows such of {FORMAT}{_CHOOSE}")
        begun = begun or (bool(packet.format) and has_key_frame(packet.data))
        if begun and packet.data:
            yield number, packet.data


def _encoded(recording: Recording, images: Numbers, problem: Callable[[str], None]) -> Iterator[tuple[int, bytes]]:
    """The frames that can be decoded as packets of H.264, each with its number; raises VideoError."""
    encoder, size = None, (0, 0)
    for number, (_, frame) in enumerate(decoded(recording, images, problem)):
        if frame is None:
            continue
        if encoder is None:
            size = frame.width, frame.height
            encoder = VideoEncoder("bgr", *size)
        if (frame.width, frame.height) != size:
            sizes = f"a frame of {frame.width} x {frame.height} pixels follows such of {size[0]} x {size[1]}"
            raise VideoError(f"{sizes}{_CHOOSE}")
        yield number, encoder.encode(frame.pixels("bgr"))


class _Mp4:
    """An MP4 of H.264 packets; ``first`` is the first one and ``begin`` its time in us since the epoch."""

    def __init__(self, files: ExitStack, path: Path, first: bytes, begin: int) -> None:
        import av

        self._packet = av.Packet
        source = files.enter_context(av.open(io.BytesIO(first), format=FORMAT))
        template = source.streams.video[0]
        self.size = template.width, template.height
        refuse_large(*self.size)
        options = {"movflags": "+faststart"}
        container: Any = files.enter_context(av.open(str(path), "w", format="mp4", options=options))
        container.metadata["creation_time"] = datetime.fromtimestamp(begin / 1e6, UTC).isoformat()
        self._stream: Any = container.add_stream_from_template(template)
        self._stream.time_base = _MICROSECOND
        self._mux = container.mux

    def add(self, data: bytes, time: int, lasting: int) -> None:
        """A packet that is shown at ``time`` for a while, both in us."""
        packet: Any = self._packet(data)
        packet.stream, packet.time_base = self._stream, _MICROSECOND
        packet.pts = packet.dts = time
        packet.duration, packet.is_keyframe = lasting, has_key_frame(data)
        self._mux(packet)


def frame_names(recording: Recording, images: Numbers, picture_type: str) -> list[str]:
    """A file name for each image message: sender stamp and sample time in us, and a number where both are taken."""
    index, taken = recording.index[images], Counter[tuple[int, int]]()
    found = []
    for key in zip(index["sender_stamp"].tolist(), index["sampled"].tolist(), strict=True):
        taken[key] += 1
        number = f"-{taken[key]}" if taken[key] > 1 else ""
        found.append(f"{key[0]}-{key[1]}{number}.{picture_type}")
    return found


def write_frames(
    recording: Recording,
    images: Numbers,
    picture_type: str,
    folder: Path,
    progress: Callable[[int], None],
    problem: Callable[[str], None],
) -> int:
    """Write each frame that can be decoded into ``folder``, as ``png`` or ``jpg``; returns how many they are.

    ``progress`` gets the number of packets done, ``problem`` a sentence about what cannot be decoded at all. Raises
    FramesError if that is all of them, and OSError.
    """
    written = 0
    pairs = zip(frame_names(recording, images, picture_type), decoded(recording, images, problem), strict=True)
    for done, (name, (_, frame)) in enumerate(pairs, 1):
        if frame is not None:
            write_picture(folder / name, frame)
            written += 1
        progress(done)
    if not written:
        raise FramesError(f"no frame of {recording.path} can be decoded")
    return written
