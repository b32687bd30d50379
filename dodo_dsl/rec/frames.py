"""The camera frames of a recording, decoded."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.opendlv.video.decoder import DecodedFrame, VideoDecoder, VideoError

IMAGE = 1055


class Packet(NamedTuple):
    """A recorded frame; ``sample_time`` is in microseconds since the epoch."""

    sender_stamp: int
    sample_time: int
    format: str
    data: bytes


def packets(recording: Recording, rows: Numbers) -> Iterator[Packet]:
    """The packets of image messages in the order of ``rows``; one that cannot be read has an empty format."""
    messages = MessageSet.standard()
    for envelope in recording.envelopes(rows):
        try:
            image = messages.decode(IMAGE, envelope.payload)  # set 0.9 has the same numbers under other names
        except MessageError:
            yield Packet(envelope.sender_stamp, envelope.sample_time, "", b"")
        else:
            yield Packet(envelope.sender_stamp, envelope.sample_time, image.format, image.data)


def decoded(
    recording: Recording, rows: Numbers, problem: Callable[[str], None]
) -> Iterator[tuple[Packet, DecodedFrame | None]]:
    """Each packet with its frame, or None if it gave none; ``problem`` gets a sentence per undecodable format."""
    decoders: dict[tuple[int, str], VideoDecoder | None] = {}
    for packet in packets(recording, rows):
        key = packet.sender_stamp, packet.format
        if key not in decoders:
            try:
                decoders[key] = VideoDecoder(packet.format) if packet.format else None
            except VideoError as error:
                problem(str(error))
                decoders[key] = None
        decoder = decoders[key]
        yield packet, decoder.decode(packet.data) if decoder else None
