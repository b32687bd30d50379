"""Recordings of tests, made message by message."""

from pathlib import Path

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet

MESSAGES = MessageSet.standard()
EPOCH = 1_700_000_000_000_000


def message(name: str, sample_time: int, received: int = 0, **fields: int | bytes) -> Envelope:
    return Envelope(
        MESSAGES.id(name), MESSAGES.encode(MESSAGES.type(name)(**fields)), sample_time, received, sample_time, 0
    )


def begin(received: int = 0) -> Envelope:
    return message("dodo.TestBegin", EPOCH, received)


def step(number: int, time: int) -> Envelope:
    """The mark of a step that ends at ``time`` us of the test."""
    return message("dodo.RecordedStep", EPOCH, number=number, time=EPOCH + time)


def write(path: Path, *envelopes: Envelope) -> Path:
    path.write_bytes(b"".join(map(encode_frame, envelopes)))
    return path
