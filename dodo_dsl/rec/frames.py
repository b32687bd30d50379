"""The camera frames of a recording, decoded."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
    cameras = sorted(set(recording.index["sender_stamp"][images].tolist()))
    if not cameras:
        raise FramesError(f"the selection of {recording.path} holds no camera frames (opendlv.proxy.ImageReading)")
    stamps = ", ".join(map(str, cameras))
    if camera is None and len(cameras) > 1:
        raise FramesError(f"{recording.path} holds frames of the cameras {stamps}; choose one with --camera")
    if camera is not None and camera not in cameras:
        raise FramesError(f"{recording.path} holds no frames of camera {camera}, expected one of {stamps}")
    return images if camera is None else images[recording.index["sender_stamp"][images] == camera]


def packets(recording: Recording, rows: Numbers) -> Iterator[Packet]:
    """The packets of image messages in the order of ``rows``; one that cannot be read has an empty format."""
    return map(packet_of, recording.envelopes(rows))


def packet_of(envelope: Envelope) -> Packet:
    """The packet of an image message; one that cannot be read has an empty format."""
    stamp, time = envelope.sender_stamp, envelope.sample_time
    try:
        image = MessageSet.standard().decode(IMAGE, envelope.payload)  # set 0.9 has the same numbers under other names
    except MessageError:
        return Packet(stamp, time, "", b"")
    return Packet(stamp, time, image.format, image.data, image.width, image.height)


def decoded(
    recording: Recording, rows: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[Packet, DecodedFrame | None]]:
    """Each packet with its frame, or None if it gave none; ``problem`` gets a sentence per reason for that.

    At most 16 pairs of a camera and a format are decoded, because each takes the memory of some frames.
    """
    decoders: dict[tuple[int, str], VideoDecoder] = {}
    reasons: set[str] = set()
    for packet in packets(recording, rows):
        frame = None
        try:
            if packet.format:
                frame = decoder_of(decoders, packet).decode(packet.data)
        except VideoError as error:
            if str(error) not in reasons and len(reasons) < MOST_DECODERS:
                reasons.add(str(error))
                problem(str(error))
        yield packet, frame
    for (sender, _), decoder in decoders.items():
        if early := decoder.early:
            come = "packet of camera {} comes" if early == 1 else "packets of camera {} come"
            problem(f"{early} {come.format(sender)} before the first key frame, and so cannot be decoded")


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


@dataclass
class PictureSet:
    """Pictures ``inside`` a folder, as ``png`` or ``jpg``; ``problem`` gets what cannot be decoded at all."""

    folder: Path
    picture_type: str
    problem: Callable[[str], None]
    inside: str = "images/"
    lost: int = 0

    def frames(
        self, recording: Recording, images: Numbers, name: str, progress: Callable[[int], None]
    ) -> Iterator[tuple[Packet, DecodedFrame, str]]:
        """The frames of a recording with the files for them; those in an earlier recording of the set have others."""
        (self.folder / self.inside).mkdir(parents=True, exist_ok=True)
        files = frame_names(recording, images, self.picture_type)
        pairs = zip(files, decoded(recording, images, self.problem), strict=True)
        for done, (file, (packet, frame)) in enumerate(pairs, 1):
            if frame is None:
                self.lost += 1
            else:
                yield packet, frame, f"{self.inside}{name}{file}"
            progress(done)

    def notes(self) -> Iterator[str]:
        """Sentences on what is missing."""
        if self.lost:
            yield f"{self.lost} packet{'s' * (self.lost > 1)} cannot be decoded"


def decoder_of(decoders: dict[tuple[int, str], VideoDecoder], packet: Packet) -> VideoDecoder:
    """The decoder of a packet's camera, a new one for the first packet; raises VideoError."""
    refuse_large(packet.width, packet.height)
    key = packet.sender_stamp, packet.format
    if key not in decoders:
        if len(decoders) == MOST_DECODERS:
            raise VideoError(f"frames of more than {MOST_DECODERS} cameras and formats are not decoded")
        decoders[key] = VideoDecoder(packet.format)
    return decoders[key]
