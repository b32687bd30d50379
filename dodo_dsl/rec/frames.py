"""The camera frames of a recording, decoded."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.video import DecodedFrame, VideoDecoder, VideoError, refuse_large

MOST_DECODERS = 16
_JPEG_QUALITY = 95


class FramesError(ValueError):
    """Missing or ambiguous frames; one sentence."""

    usage = True


class Packet(NamedTuple):
    """A recorded frame; ``sample_time`` is in microseconds since the epoch, width and height are the message's."""

    sender_stamp: int
    sample_time: int
    format: str
    data: bytes
    width: int = 0
    height: int = 0


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


def packet_of(envelope: Envelope) -> Packet:
    """The packet of an image message; one that cannot be read has an empty format."""
    stamp, time = envelope.sender_stamp, envelope.sample_time
    try:
        image = MessageSet.standard().decode(IMAGE, envelope.payload)  # set 0.9 has the same numbers under other names
    except MessageError:
        return Packet(stamp, time, "", b"")
    return Packet(stamp, time, image.format, image.data, image.width, image.height)


class FrameDecoder:
    """Decodes packets, those of each camera and format in their order.

    At most 16 pairs of these are decoded, because each takes the memory of some frames.
    """

    def __init__(self) -> None:
        self._decoders: dict[tuple[int, str], VideoDecoder] = {}

    def decode(self, packet: Packet) -> DecodedFrame | None:
        """The frame, None of a packet without one; raises VideoError for what is never decoded."""
        if not packet.format:
            return None
        refuse_large(packet.width, packet.height)
        key = packet.sender_stamp, packet.format
        if key not in self._decoders:
            if len(self._decoders) == MOST_DECODERS:
                raise VideoError(f"frames of more than {MOST_DECODERS} cameras and formats are not decoded")
            self._decoders[key] = VideoDecoder(packet.format)
        return self._decoders[key].decode(packet.data)

    def early(self) -> Iterator[str]:
        """Sentences on packets before the first key frames."""
        for (sender, _), decoder in self._decoders.items():
            if early := decoder.early:
                come = "packet of camera {} comes" if early == 1 else "packets of camera {} come"
                yield f"{early} {come.format(sender)} before the first key frame, and so cannot be decoded"


def decoded(
    recording: Recording, rows: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[Packet, DecodedFrame | None]]:
    """The packet of each image message with its frame; ``problem`` gets a sentence per reason for one without."""
    decoder, reasons = FrameDecoder(), set[str]()
    for packet in map(packet_of, recording.envelopes(rows)):
        frame = None
        try:
            frame = decoder.decode(packet)
        except VideoError as error:
            if str(error) not in reasons and len(reasons) < MOST_DECODERS:
                reasons.add(str(error))
                problem(str(error))
        yield packet, frame
    for text in decoder.early():
        problem(text)


def frames(
    recording: Recording, images: Numbers, progress: Callable[[int], None], problem: Callable[[str], None]
) -> Iterator[tuple[int, Packet, DecodedFrame]]:
    """The frames that can be decoded, each with its number among ``images``; raises FramesError if there is none.

    ``progress`` gets how many packets are done, ``problem`` sentences on those without a frame.
    """
    lost = 0
    for number, (packet, frame) in enumerate(decoded(recording, images, problem)):
        if frame is None:
            lost += 1
        else:
            yield number, packet, frame
        progress(number + 1)
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
