"""The camera frames of a recording, decoded."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.opendlv.video.decoder import DecodedFrame, VideoDecoder, VideoError, refuse_large

IMAGE = 1055


MOST_DECODERS = 16


class Packet(NamedTuple):
    """A recorded frame; ``sample_time`` is in microseconds since the epoch, width and height are the message's."""

    sender_stamp: int
    sample_time: int
    format: str
    data: bytes
    width: int = 0
    height: int = 0


def packets(recording: Recording, rows: Numbers) -> Iterator[Packet]:
    """The packets of image messages in the order of ``rows``; one that cannot be read has an empty format."""
    messages = MessageSet.standard()
    for envelope in recording.envelopes(rows):
        try:
            image = messages.decode(IMAGE, envelope.payload)  # set 0.9 has the same numbers under other names
        except MessageError:
            yield Packet(envelope.sender_stamp, envelope.sample_time, "", b"")
        else:
            yield Packet(
                envelope.sender_stamp, envelope.sample_time, image.format, image.data, image.width, image.height
            )


def decoded(
    recording: Recording, rows: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[Packet, DecodedFrame | None]]:
    """Each packet with its frame, or None if it gave none; ``problem`` gets a sentence per reason for that.

    At most 16 pairs of a camera and a format are decoded, as each takes the memory of some frames.
    """
    decoders: dict[tuple[int, str], VideoDecoder] = {}
    reasons: set[str] = set()
    for packet in packets(recording, rows):
        frame = None
        try:
            if packet.format:
                frame = _decoder(decoders, packet).decode(packet.data)
        except VideoError as error:
            if str(error) not in reasons and len(reasons) < MOST_DECODERS:
                reasons.add(str(error))
                problem(str(error))
        yield packet, frame


def _decoder(decoders: dict[tuple[int, str], VideoDecoder], packet: Packet) -> VideoDecoder:
    """The decoder of a packet's camera, a new one for the first packet; raises VideoError."""
    refuse_large(packet.width, packet.height)
    key = packet.sender_stamp, packet.format
    if key not in decoders:
        if len(decoders) == MOST_DECODERS:
            raise VideoError(f"frames of more than {MOST_DECODERS} cameras and formats are not decoded")
        decoders[key] = VideoDecoder(packet.format)
    return decoders[key]
