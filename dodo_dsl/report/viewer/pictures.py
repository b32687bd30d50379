"""The camera's frames of a recording as a video that browsers play, without encoding them again."""

import contextlib
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.picture_size import too_large
from dodo_dsl.opendlv.recording import Recording, RecordingError
from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING, SNAPSHOT
from dodo_dsl.report.files import FRAME, VIDEOS
from dodo_dsl.report.viewer.recorded import MICROSECONDS, PICTURES, RecordedTest

MOST_BYTES = 32_000_000
"""Of all videos of a test, in equal parts; the oldest frames are left out."""
_FORMATS = ("h264", "H264")
ANNOUNCED = "opendlv.proxy.ImageReadingShm"
_WIDTH, _SAME = 320, 1e-3
_START, _IDR, _SET = b"\x00\x00\x01", 5, 7


@dataclass(frozen=True)
class Video:
    """A camera's video: the file next to the page, the size in pixels, and the time of each frame in s of the test."""

    file: str
    width: int
    height: int
    times: list[float]


@dataclass(frozen=True)
class Replayed:
    """A recording whose part from ``begin`` to ``end``, in s since its first message, a test played with its frames."""

    path: Path
    sender: int
    begin: float
    end: float


Images = list[tuple[int, Any]]
"""Sample times in us and messages of one camera, each later than the one before."""


def write(folder: Path, replayed: Sequence[Replayed], test: RecordedTest, messages: MessageSet) -> Iterator[Video]:
    """A video in ``folder`` of each camera in a test's recordings, a few at most, as far as they are H.264.

    Of a test that recorded none, they are those that it ``replayed``.
    """
    cameras = [
        images for name in (RECORDING, PICTURES_FILE) for images in _cameras(folder / name, messages)[1].values()
    ]
    cameras = (cameras or [found for each in replayed if (found := _played(each, test, messages))])[: len(VIDEOS)]
    for images, name in zip(cameras, VIDEOS, strict=False):
        if video := _write(folder / name, images, test.begin, MOST_BYTES // len(cameras)):
            yield video


def _write(target: Path, images: Images, begin: int, most_bytes: int) -> Video | None:
    import av

    kept = _kept(images, most_bytes)
    first = kept[0][1] if kept else None
    if first is None or first.format not in _FORMATS or too_large(first.width, first.height):
        return None
    with contextlib.suppress(av.FFmpegError):
        with atomic.replacing(target) as part:
            _mux(part, [(time, image.data) for time, image in kept])
        times = [round((time - begin) / MICROSECONDS, 4) for time, _ in kept]
        return Video(target.name, first.width, first.height, times)
    return None


def _cameras(recording: Path, messages: MessageSet, sender: int | None = None) -> tuple[int, dict[int, Images]]:
    """When a recording begins, in us, and its frames by sender stamp; nothing of one that is missing or empty."""
    found, id_ = dict[int, Images](), messages.id(PICTURES)
    try:
        with Recording(recording) as opened:
            begin = int(opened.index["time"].min()) if len(opened) else 0
            for envelope in opened.envelopes(opened.rows({id_}, sender_stamps=None if sender is None else {sender})):
                images = found.setdefault(envelope.sender_stamp, [])
                if not images or envelope.sample_time > images[-1][0]:
                    images.append((envelope.sample_time, messages.decode(id_, envelope.payload)))
    except (OSError, RecordingError):
        return 0, {}
    return begin, dict(sorted(found.items()))


def _played(replayed: Replayed, test: RecordedTest, messages: MessageSet) -> Images:
    """The frames of a recording at the times at which the test announced them, one after the other."""
    announced = test.channel(ANNOUNCED, replayed.sender)
    begin, cameras = _cameras(replayed.path, messages, replayed.sender)
    images = cameras.get(replayed.sender, [])
    played = [image for image in images if replayed.begin <= (image[0] - begin) / MICROSECONDS <= replayed.end]
    times = [] if announced is None or announced.every > 1 else announced.times.tolist()
    return [(test.begin + round(t * MICROSECONDS), image) for t, (_, image) in zip(times, played, strict=False)]


def shrink_snapshot(folder: Path) -> None:
    """Makes the small picture of the recorder's snapshot, if there is one and no other; raises OSError."""
    import cv2

    pixels = cv2.imread(str(folder / SNAPSHOT)) if (folder / SNAPSHOT).is_file() else None
    if pixels is not None:
        if not (folder / FRAME).exists():
            _write_small(folder, pixels)
        (folder / SNAPSHOT).unlink()


def _write_small(folder: Path, pixels: Any) -> None:
    import cv2

    small = cv2.resize(pixels, (_WIDTH, round(_WIDTH * pixels.shape[0] / pixels.shape[1])))
    atomic.write_bytes(folder / FRAME, cv2.imencode(".jpg", small)[1].tobytes())


def write_frame(folder: Path, video: Video, time: float) -> None:
    """The last frame of a video until a time, as a small picture; nothing if it cannot be decoded. Raises OSError."""
    import av

    wanted, picture = max(time - video.times[0], 0.0), None
    with contextlib.suppress(av.FFmpegError), av.open(str(folder / video.file)) as container:
        container.seek(round(wanted * av.time_base))
        for frame in container.decode(video=0):
            if picture is not None and (frame.time or 0.0) > wanted + _SAME:
                break
            picture = frame
        if picture is not None:
            _write_small(folder, picture.to_ndarray(format="bgr24"))


def _kept(images: Images, most_bytes: int) -> Images:
    """The newest of them that fit, from one that stands alone on."""
    size, first = 0, len(images)
    for number in range(len(images) - 1, -1, -1):
        size += len(images[number][1].data)
        if size > most_bytes:
            break
        if _stands_alone(images[number][1].data):
            first = number
    return images[first:]


def _stands_alone(packet: bytes) -> bool:
    at = packet.find(_START)
    while at >= 0 and at + 3 < len(packet):
        if packet[at + 3] & 0x1F in (_IDR, _SET):
            return True
        at = packet.find(_START, at + 3)
    return False


def _mux(path: Path, packets: Sequence[tuple[int, bytes]]) -> None:
    """An MP4 of H.264 packets, its first frame at 0 s; raises FFmpegError."""
    import av

    begin = packets[0][0]
    with (
        av.open(io.BytesIO(packets[0][1]), format="h264") as source,
        av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container,
    ):
        stream = container.add_stream_from_template(source.streams.video[0])
        for time, data in packets:
            packet = av.Packet(data)
            packet.stream, packet.time_base = stream, Fraction(1, 10_000)
            packet.pts = packet.dts = (time - begin) // 100
            packet.is_keyframe = _stands_alone(data)
            container.mux(packet)
