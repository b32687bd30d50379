"""What clock and services exchange in lockstep, split into datagrams and reassembled."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from dodo_dsl.opendlv.bus.envelope import HEADER_BYTES, Envelope, FrameError, body_length, decode_frame, encode_frame

STEP, STEP_DONE = "dodo.Step", "dodo.StepDone"
PART_BYTES = 60_000


class EncodedEnvelope(NamedTuple):
    """An envelope with its frame, so that it is encoded once for all receivers."""

    envelope: Envelope
    frame: bytes


def encode(envelope: Envelope) -> EncodedEnvelope:
    """The envelope, encoded; raises FrameError."""
    return EncodedEnvelope(envelope, encode_frame(envelope))


def split(frames: Iterable[bytes]) -> list[bytes]:
    """Frames one after the other, in parts that datagrams can hold; one empty part for none."""
    data = b"".join(frames)
    return [data[start : start + PART_BYTES] for start in range(0, len(data), PART_BYTES)] or [b""]


def decode(data: bytes) -> Iterator[EncodedEnvelope]:
    """The envelopes in reassembled data; raises FrameError."""
    offset = 0
    while offset < len(data):
        end = offset + HEADER_BYTES + body_length(data[offset : offset + HEADER_BYTES])
        if end > len(data):
            raise FrameError(f"a step's frame has {len(data) - offset} bytes of {end - offset}")
        frame = data[offset:end]
        yield EncodedEnvelope(decode_frame(frame), frame)
        offset = end


@dataclass
class Reassembly:
    """Reassembly of one message as they come, in any order and more than once."""

    number: int = -1
    parts: int = 1
    received: dict[int, bytes] = field(default_factory=dict)

    def take(self, number: int, part: int, parts: int, data: bytes) -> bytes | None:
        """The whole message when this was the last missing part, else None."""
        if number != self.number:
            self.number, self.parts, self.received = number, max(1, parts), {}
        if part in self.received or not 0 <= part < self.parts:
            return None
        self.received[part] = data
        if len(self.received) < self.parts:
            return None
        return b"".join(self.received[i] for i in range(self.parts))
