"""What the clock and the services tell each other in lockstep, cut into datagrams and put together again."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from dodo_dsl.opendlv.bus.envelope import HEADER_BYTES, Envelope, FrameError, body_length, decode_frame, encode_frame

STEP, STEP_DONE = "dodo.Step", "dodo.StepDone"
PART_BYTES = 60_000


class Said(NamedTuple):
    """An envelope with its frame, so that it is encoded once however many hear it."""

    envelope: Envelope
    frame: bytes


def say(envelope: Envelope) -> Said:
    """The envelope, encoded; raises FrameError."""
    return Said(envelope, encode_frame(envelope))


def cut(frames: Iterable[bytes]) -> list[bytes]:
    """Frames one after the other, in pieces that datagrams can hold; one empty piece for none."""
    data = b"".join(frames)
    return [data[start : start + PART_BYTES] for start in range(0, len(data), PART_BYTES)] or [b""]


def frames(data: bytes) -> Iterator[Said]:
    """The envelopes in such pieces put together; raises FrameError."""
    offset = 0
    while offset < len(data):
        end = offset + HEADER_BYTES + body_length(data[offset : offset + HEADER_BYTES])
        if end > len(data):
            raise FrameError(f"a step's frame has {len(data) - offset} bytes of {end - offset}")
        frame = data[offset:end]
        yield Said(decode_frame(frame), frame)
        offset = end


@dataclass
class Pieces:
    """Pieces of one message as they come, in any order and more than once."""

    number: int = -1
    parts: int = 1
    pieces: dict[int, bytes] = field(default_factory=dict)

    def take(self, number: int, part: int, parts: int, data: bytes) -> bytes | None:
        """All of the message when this piece was the last that was missing, else None."""
        if number != self.number:
            self.number, self.parts, self.pieces = number, max(1, parts), {}
        if part in self.pieces or part >= self.parts:
            return None
        self.pieces[part] = data
        if len(self.pieces) < self.parts:
            return None
        return b"".join(self.pieces[i] for i in range(self.parts))
