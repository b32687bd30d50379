"""The pixel formats of camera frames in shared memory, and images from and to them.

``argb`` has 4 bytes per pixel, in memory blue, green, red, alpha; ``bgr`` 3, and ``rgb`` in the order of its letters;
``i420`` planes of brightness and, at half the width and height, of two colours (12 bits per pixel).
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]

FORMATS = ("argb", "i420", "bgr", "rgb")
"""Services that show images offer the first two, and the others where ``name.bgr`` and ``name.rgb`` ask for them."""
HALF_BYTES = {"argb": 8, "bgr": 6, "i420": 3, "rgb": 6}  # twice the bytes a pixel


class PixelError(ValueError):
    """A memory's size, or a format's name, that fits no image."""


def size(format_: str, width: int, height: int) -> int:
    """Bytes of an image; raises PixelError for an unknown format, and for i420 with an odd width or height."""
    if format_ not in FORMATS:
        raise PixelError(f"unknown pixel format '{format_}', expected one of {', '.join(FORMATS)}")
    if format_ == "i420" and (width % 2 or height % 2):
        raise PixelError(f"i420 needs an even width and height, not {width} x {height}")
    return width * height * HALF_BYTES[format_] // 2


def view(data: Any, format_: str, width: int, height: int) -> Picture:
    """The bytes of a memory as an array, without a copy; raises PixelError if there are too few.

    Its shape is (height, width, 4) for argb, (height, width, 3) for bgr and rgb, and (height * 3 / 2, width) for i420;
    bytes behind the image are left out.
    """
    wanted = size(format_, width, height)
    flat = np.frombuffer(data, np.uint8)
    if flat.size < wanted:
        raise PixelError(f"{flat.size} bytes are too few for {format_} of {width} x {height} pixels, {wanted} bytes")
    shape = (height * 3 // 2, width) if format_ == "i420" else (height, width, HALF_BYTES[format_] // 2)
    return flat[:wanted].reshape(shape)


_ORDERS = {"argb": "BGRA", "bgr": "BGR", "rgb": "RGB", "rgba": "RGBA", "mono": "GRAY", "i420": "YUV_I420"}


def converted(picture: Picture, had: str, wanted: str) -> Picture:
    """A copy of an image in another format, shaped as ``view`` has it, or ``rgba`` or ``mono``; alpha is 255.

    Raises PixelError for i420 with an odd width or height.
    """
    if had == wanted:
        return picture.copy()
    if wanted == "i420":
        size(wanted, picture.shape[1], picture.shape[0])
    import cv2

    code = f"YUV2{_ORDERS[wanted]}_I420" if had == "i420" else f"{_ORDERS[had]}2{_ORDERS[wanted]}"
    return np.asarray(cv2.cvtColor(picture, getattr(cv2, f"COLOR_{code}")), np.uint8)


def with_copies(argb: Picture, i420: Picture | None, formats: Iterable[str]) -> dict[str, Picture]:
    """An image by its formats: the two that there are, and those of ``formats`` that have to be made of argb."""
    pictures = {"argb": argb} if i420 is None else {"argb": argb, "i420": i420}
    return {each: converted(argb, "argb", each) for each in formats if each not in ("argb", "i420")} | pictures
