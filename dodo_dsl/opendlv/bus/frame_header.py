"""The header of a frame: ``0D A4`` and the length of the envelope behind it."""

MAGIC = b"\x0d\xa4"
HEADER_BYTES = 5


class FrameError(ValueError):
    """Bytes that are no frame, or an envelope that fits in none."""


def body_length(header: bytes) -> int:
    """The length in bytes of the envelope that follows a header of 5 bytes; raises FrameError."""
    if len(header) < HEADER_BYTES or header[:2] != MAGIC:
        raise FrameError("not a frame: the header is missing")
    return int.from_bytes(header[2:5], "little")
