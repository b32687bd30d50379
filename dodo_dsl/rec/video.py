"""The frames of a camera as an MP4 of H.264, each shown at its sample time."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame, VideoError, pyav
from dodo_dsl.rec.frames import FramesError, frames

MOST_GAP = 1_800_000_000
"""us between two frames; an MP4 counts the time of a frame in 32 bits."""
_MICROSECOND = Fraction(1, 1_000_000)
_ENCODING = {"crf": "18", "preset": "veryfast", "tune": "zerolatency"}


def write_video(
    recording: Recording, images: Numbers, place: Path, problem: Callable[[str], None]
) -> tuple[int, tuple[int, int]]:
    """Write the frames of one camera; how many they are, and their width and height.

    Each is shown at least 1 us and at most MOST_GAP after the one before. ``problem`` gets a sentence about what cannot
    be decoded. Raises FramesError if nothing can be written, or frames do not fit into one file, and OSError.
    """
    av = pyav("encoded")
    count = shown = last = 0
    size = (0, 0)
    stream: Any = None
    try:
        with av.open(str(place), "w", format="mp4", options={"movflags": "+faststart"}) as container:
            for _, envelope, frame in frames(recording, images, problem):
                if stream is None:
                    size, last = (frame.width, frame.height), envelope.sample_time
                    stream = _stream(container, *size)
                else:
                    _refuse_other(frame, *size)
                    shown += min(max(envelope.sample_time - last, 1), MOST_GAP)
                    last = max(envelope.sample_time, last + 1)
                picture = av.VideoFrame.from_ndarray(frame.pixels("bgr"), format="bgr24")
                picture.pts, picture.time_base = shown, _MICROSECOND
                container.mux(stream.encode(picture))
                count += 1
            container.mux(stream.encode())
    except av.FFmpegError as error:
        if isinstance(error, OSError):  # the disk is to blame
            raise OSError(error.errno, error.strerror) from None
        raise FramesError(f"{recording.path}: frames cannot be put into a video: {error}") from None
    except VideoError as error:
        raise FramesError(f"{recording.path}: {error}") from None
    return count, size


def _refuse_other(frame: DecodedFrame, width: int, height: int) -> None:
    if (frame.width, frame.height) != (width, height):
        sizes = f"a frame of {frame.width} x {frame.height} pixels follows such of {width} x {height}"
        raise VideoError(f"{sizes}; choose a part with --start and --end")


def _stream(container: Any, width: int, height: int) -> Any:
    if width % 2 or height % 2:
        raise VideoError(f"h264 needs an even width and height, not {width} x {height}")
    stream = container.add_stream("libx264", options=_ENCODING)
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
    stream.time_base = stream.codec_context.time_base = _MICROSECOND
    stream.codec_context.gop_size, stream.codec_context.thread_count = 10, 1
    return stream
