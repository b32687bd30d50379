"""The camera frames of a recording (``opendlv.proxy.ImageReading``), decoded one after the other."""

from typing import NamedTuple

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.video import DecodedFrame, VideoDecoder, VideoError, refuse_large

MOST_DECODERS = 16


class Packet(NamedTuple):
    """A recorded frame; ``sample_time`` is in microseconds since the epoch, width and height are the message's."""

    sender_stamp: int
    sample_time: int
    format: str
    data: bytes
    width: int = 0
    height: int = 0


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

    @property
    def early(self) -> int:
        """Packets that came before the first key frames."""
        return sum(decoder.early for decoder in self._decoders.values())
