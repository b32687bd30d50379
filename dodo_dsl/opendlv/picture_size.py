"""Width and height of images, read before they are decoded: a file of a megabyte may unfold to gigabytes."""

import zlib

MAX_PIXELS = 7680 * 4320
"""Of an image that is decoded: 8K, which takes 133 MB as B, G, R, A."""

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
_PNG_AROUND = 12
"""Bytes around the content of a part of a PNG: its length, name and checksum."""
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
    """Why an image file cannot be decoded here, without its name; empty when it can, as far as its header shows."""
    size = picture_size(data)
    if size is None:
        return "not a readable image, expected PNG or JPEG"
    return too_large(*size) or ("" if all(size) else "an image without an area") or _cut(data)


def _cut(data: bytes) -> str:
    """Where a file ends before its image does, or a part of a PNG is damaged; empty for whole ones."""
    if data.startswith(_JPEG):
        return "" if _JPEG_END in data else f"the image is cut: its {len(data)} bytes have no end"
    at = len(_PNG)
    while at + _PNG_AROUND <= len(data):
        end = at + _PNG_AROUND + _number(data, at, 4)
        if end > len(data):
            break
        if zlib.crc32(memoryview(data)[at + 4 : end - 4]) != _number(data, end - 4, 4):
            return f"the image is damaged at byte {at}: a checksum is wrong"
        if data[at + 4 : at + 8] == b"IEND":
            return ""
        at = end
    return f"the image is cut: its {len(data)} bytes have no end"


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
