"""Width and height of pictures, read before they are decoded: a file of a megabyte may unfold to gigabytes."""

MAX_PIXELS = 7680 * 4320
"""Of a picture that is decoded: 8K, which takes 133 MB as B, G, R, A."""

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""JPEG's markers without a length (ITU-T T.81, table B.1)."""
_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""JPEG's markers of a frame, which has the size."""


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in the header of a PNG or JPEG file; None for anything else."""
    if data.startswith(_PNG):
        has_header = data[12:16] == b"IHDR" and len(data) >= 24
        return (_number(data, 16, 4), _number(data, 20, 4)) if has_header else None
    return _jpeg_size(data) if data.startswith(_JPEG) else None


def problem_of(data: bytes) -> str:
    """Why a picture file cannot be decoded here, without its name; empty when it can, as far as its header tells."""
    size = picture_size(data)
    return "not a readable picture, expected PNG or JPEG" if size is None else too_large(*size)


def too_large(width: int, height: int) -> str:
    """A sentence on a picture that is too large to be decoded; empty for others."""
    if width * height <= MAX_PIXELS:
        return ""
    return f"a picture of {width} x {height} pixels, expected at most {MAX_PIXELS} in all"


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    at = len(_JPEG)
    while (at := data.find(b"\xff", at)) >= 0 and at + 9 <= len(data):
        marker = data[at + 1]
        if marker in (0x00, 0xFF) or marker in _ALONE:
            at += 1
        elif marker in _FRAMES:
            return _number(data, at + 7, 2), _number(data, at + 5, 2)
        else:
            at += 2 + max(2, _number(data, at + 2, 2))
    return None


def _number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "big")
