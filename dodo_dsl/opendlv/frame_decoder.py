"""The camera frames of a recording (``opendlv.proxy.ImageReading``), decoded one after the other."""

from typing import Any

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.video import DecodedFrame, VideoDecoder, VideoError, refuse_large

MOST_DECODERS = 16


def image_of(envelope: Envelope) -> Any:
    """The image message of an envelope; an empty one where it cannot be read."""
    messages = MessageSet.standard()  # set 0.9 has the same numbers under other names
    try:
        return messages.decode(IMAGE, envelope.payload)
    except MessageError:
        return messages.type(IMAGE)()


class FrameDecoder:
    """Decodes image messages, those of each camera and format in their order.

    At most 16 pairs of these are decoded, because each takes the memory of some frames.
    """

    def __init__(self) -> None:
        self._decoders: dict[tuple[int, str], VideoDecoder] = {}

    def decode(self, envelope: Envelope) -> DecodedFrame | None:
        """The frame, None of a message without one; raises VideoError for what is never decoded."""
        image = image_of(envelope)
        if not image.format:
            return None
        refuse_large(image.width, image.height)
        key = envelope.sender_stamp, image.format
        if key not in self._decoders:
            if len(self._decoders) == MOST_DECODERS:
                raise VideoError(f"frames of more than {MOST_DECODERS} cameras and formats are not decoded")
            self._decoders[key] = VideoDecoder(image.format)
        return self._decoders[key].decode(image.data)

    @property
    def early(self) -> int:
        """Packets that came before the first key frames."""
        return sum(decoder.early for decoder in self._decoders.values())
