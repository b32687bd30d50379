"""Recordings (``.rec``): frames one after the other, without header or footer, read as a stream."""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from dodo_dsl.opendlv.envelope import HEADER_BYTES, MAGIC, Envelope, FrameError, body_length, decode_body

_CHUNK = 1 << 20


def read_envelopes(path: Path) -> Iterator[Envelope]:
    """The envelopes of a recording in file order; bytes that are no frame are passed over to the next header.

    Memory is bounded by the largest frame, 16 MiB. Raises OSError for an unreadable file.
    """
    with path.open("rb") as stream:
        yield from _envelopes(stream)


def _envelopes(stream: BinaryIO) -> Iterator[Envelope]:
    buffer, at, ended = b"", 0, False
    while True:
        step = _step(buffer, at)
        if step is not None:
            envelope, at = step
            if envelope is not None:
                yield envelope
        elif ended:
            if at >= len(buffer):
                return
            at += 1  # a truncated frame at the end may hide whole ones
        else:
            chunk = stream.read(_CHUNK)
            buffer, at, ended = buffer[at:] + chunk, 0, not chunk


def _step(buffer: bytes, at: int) -> tuple[Envelope | None, int] | None:
    """An envelope (None for bytes passed over) and where to go on, or None when more bytes are needed."""
    if len(buffer) - at < HEADER_BYTES:
        return None
    if buffer[at : at + 2] != MAGIC:
        found = buffer.find(MAGIC, at)
        return None, found if found >= 0 else len(buffer) - 1
    end = at + HEADER_BYTES + body_length(buffer[at : at + HEADER_BYTES])
    if end > len(buffer):
        return None
    try:
        return decode_body(buffer[at + HEADER_BYTES : end]), end
    except FrameError:
        return None, at + 1
