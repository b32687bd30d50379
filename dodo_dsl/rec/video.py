"""The frames of a camera as an MP4, each shown at its time.

Packets of H.264 are as they were recorded, others encoded again.
"""

import io
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
from dodo_dsl.rec.frames import FramesError, decoded, packets

MOST_GAP = 1_800_000_000
"""us between two frames; an MP4 counts the time of a frame in 32 bits."""
_LASTING = 100_000
"""us that the last frame is shown."""
_MICROSECOND = Fraction(1, 1_000_000)
_SHOWN = 40
_CHOOSE = ", and both do not fit into one video; choose a part with --start and --end"


@dataclass(frozen=True)
class VideoFile:
    """What became of the packets: ``frames`` of ``size`` in the file, ``moved`` of them shown at another time than
    they were taken, and whether they were ``encoded`` again.
    """

    frames: int
    size: tuple[int, int]
    moved: int
    encoded: bool


def write_video(
    recording: Recording,
    images: Numbers,
    place: Path,
    progress: Callable[[int], None],
    problem: Callable[[str], None],
) -> VideoFile:
    """Write the image messages of one camera, from the first key frame on, with their sample times.

    Each is shown at least 1 us and at most MOST_GAP after the one before. ``progress`` gets the number of packets done,
    ``problem`` a sentence about what cannot be decoded at all. Raises FramesError if nothing can be written, or frames
    do not fit into one file, and OSError.
    """
    import av

    format_ = next((packet.format for packet in packets(recording, images) if packet.format), "")
    is_h264 = CODECS.get(format_) == FORMAT
    found = _recorded(recording, images) if is_h264 else _encoded(recording, images, problem)
    frames = moved = shown = last = 0
    with _readable_errors(recording.path), ExitStack() as files:
        for number, data in found:
            time = int(recording.index["time"][images[number]])
            if not frames:
                stream, size = _stream(files, place, data, time)
            else:
                step = min(max(time - last, 1), MOST_GAP)
                moved += step != time - last
                shown += step
            last = max(time, last + 1) if frames else time
            packet: Any = av.Packet(data)
            packet.stream, packet.time_base, packet.pts, packet.dts = stream, _MICROSECOND, shown, shown
            packet.duration, packet.is_keyframe = _LASTING, has_key_frame(data)
            stream.container.mux(packet)
            frames += 1
            progress(number + 1)
    if not frames:
        raise FramesError(f"no frame of {recording.path} can be decoded")
    return VideoFile(frames, size, moved, not is_h264)


def _stream(files: ExitStack, path: Path, first: bytes, begin: int) -> tuple[Any, tuple[int, int]]:
    """The stream of a new MP4 for H.264 as in the ``first`` packet, taken ``begin`` us after 1970, and its size."""
    import av

    template = files.enter_context(av.open(io.BytesIO(first), format=FORMAT)).streams.video[0]
    refuse_large(template.width, template.height)
    options = {"movflags": "+faststart"}
    container: Any = files.enter_context(av.open(str(path), "w", format="mp4", options=options))
    container.metadata["creation_time"] = datetime.fromtimestamp(begin / 1e6, UTC).isoformat()
    stream: Any = container.add_stream_from_template(template)
    stream.time_base = _MICROSECOND
    return stream, (template.width, template.height)


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
