"""The camera frames of a recording, decoded."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.frame_decoder import FrameDecoder
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame, VideoError

MOST_REASONS = 16
_JPEG_QUALITY = 95


class FramesError(ValueError):
    """Missing or ambiguous frames; one sentence."""

    usage = True


def images_of(recording: Recording, rows: Numbers, camera: int | None) -> Numbers:
    """The image messages of one camera among some rows; raises FramesError for none, or for several."""
    index = recording.index[rows]
    images: Numbers = rows[index["data_type"] == IMAGE]
    senders = recording.index["sender_stamp"][images]
    cameras = sorted(set(senders.tolist()))
    if not cameras:
        raise FramesError(f"the selection of {recording.path} holds no camera frames (opendlv.proxy.ImageReading)")
    stamps = ", ".join(map(str, cameras))
    if camera is None and len(cameras) > 1:
        raise FramesError(f"{recording.path} holds frames of the cameras {stamps}; choose one with --camera")
    if camera is not None and camera not in cameras:
        raise FramesError(f"{recording.path} holds no frames of camera {camera}, expected one of {stamps}")
    return images if camera is None else images[senders == camera]


def decoded(
    recording: Recording, rows: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[Envelope, DecodedFrame | None]]:
    """Each image message with its frame; ``problem`` gets a sentence per reason for one without."""
    decoder, reasons = FrameDecoder(), set[str]()
    for envelope in recording.envelopes(rows):
        frame = None
        try:
            frame = decoder.decode(envelope)
        except VideoError as error:
            if str(error) not in reasons and len(reasons) < MOST_REASONS:
                reasons.add(str(error))
                problem(str(error))
        yield envelope, frame
    if early := decoder.early:
        come = "packet comes" if early == 1 else "packets come"
        problem(f"{early} {come} before the first key frame, and so cannot be decoded")


def frames(
    recording: Recording, images: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[int, Envelope, DecodedFrame]]:
    """The frames that can be decoded, each with its number among ``images``; raises FramesError if there is none.

    ``problem`` gets sentences on packets without a frame.
    """
    lost = 0
    for number, (envelope, frame) in enumerate(decoded(recording, images, problem)):
        if frame is None:
            lost += 1
        else:
            yield number, envelope, frame
    if lost == len(images):
        raise FramesError(f"no frame of {recording.path} can be decoded")
    if lost:
        problem(f"{lost} packet{'s' * (lost > 1)} cannot be decoded")


def write_picture(path: Path, frame: DecodedFrame) -> None:
    """Writes a frame as PNG or JPEG, as the name ends; raises OSError."""
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if path.suffix == ".jpg" else []
    done, data = cv2.imencode(path.suffix, frame.pixels("bgr"), options)
    if not done:
        raise OSError(f"{path.name} cannot be encoded")
    path.write_bytes(data.tobytes())


def frame_names(recording: Recording, images: Numbers, picture_type: str) -> list[str]:
    """A file name for each image message: sender stamp and sample time in us, and a number where both are taken."""
    index, taken = recording.index[images], Counter[tuple[int, int]]()
    found = []
    for key in zip(index["sender_stamp"].tolist(), index["sampled"].tolist(), strict=True):
        taken[key] += 1
        number = f"-{taken[key]}" if taken[key] > 1 else ""
        found.append(f"{key[0]}-{key[1]}{number}.{picture_type}")
    return found
