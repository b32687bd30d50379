"""Width and height of images, read before they are decoded: a file of a megabyte may unfold to gigabytes."""

MAX_PIXELS = 7680 * 4320
"""Of an image that is decoded: 8K, which takes 133 MB as B, G, R, A."""

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""JPEG's markers without a length (ITU-T T.81, table B.1)."""
_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""JPEG's markers of a frame, which has the size."""


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in the header of a PNG or JPEG file; None for anything else."""
    if data.startswith(_PNG):
        return (_number(data, 16, 4), _number(data, 20, 4)) if data[12:16] == b"IHDR" and len(data) >= 24 else None
    return _jpeg_size(data) if data.startswith(_JPEG) else None


def problem_of(data: bytes) -> str:
    """Why an image file cannot be decoded here, without its name; empty when it can, as far as its ends show."""
    size = picture_size(data)
    if size is None:
        return "not a readable image, expected PNG or JPEG"
    end = _JPEG_END if data.startswith(_JPEG) else _PNG_END
    cut = "" if end in data else f"the image is cut: its {len(data)} bytes have no end"
    return too_large(*size) or ("" if all(size) else "an image without an area") or cut


def too_large(width: int, height: int) -> str:
    """A sentence on an image that is too large to be decoded; empty for others."""
    if width * height <= MAX_PIXELS:
        return ""
    return f"an image of {width} x {height} pixels, expected at most {MAX_PIXELS} in all"


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
