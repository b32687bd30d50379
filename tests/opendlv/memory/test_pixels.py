import cv2
import numpy as np
import pytest

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.pixels import PixelError

WIDTH, HEIGHT = 64, 48
SMOOTH = cv2.resize(np.random.default_rng(3).integers(100, 156, (3, 4, 3), np.uint8), (WIDTH, HEIGHT))


@pytest.mark.parametrize(("format_", "size"), [("argb", 12288), ("bgr", 9216), ("rgb", 9216), ("i420", 4608)])
def test_a_picture_goes_through_memory(format_: str, size: int) -> None:
    assert pixels.size(format_, WIDTH, HEIGHT) == size
    memory = bytearray(size + 5)
    pixels.view(memory, format_, WIDTH, HEIGHT)[:] = pixels.converted(SMOOTH, "bgr", format_)
    back = pixels.converted(pixels.view(memory, format_, WIDTH, HEIGHT), format_, "bgr")
    error = np.abs(back.astype(int) - SMOOTH)
    assert error.max() == 0 if format_ != "i420" else error.mean() < 3
    assert memory[size:] == bytes(5)


def test_the_order_of_the_bytes() -> None:
    red = np.zeros((2, 2, 3), np.uint8)
    red[..., 2] = 255
    assert pixels.converted(red, "bgr", "argb").tobytes() == b"\x00\x00\xff\xff" * 4
    assert pixels.converted(red, "bgr", "rgb").tobytes() == b"\xff\x00\x00" * 4
    assert pixels.converted(red, "bgr", "i420").tobytes() == bytes([82] * 4 + [90, 240])  # ITU-R BT.601


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: pixels.size("yuyv", 2, 2), "unknown pixel format 'yuyv'"),
        (lambda: pixels.size("i420", 3, 2), "even width and height, not 3 x 2"),
        (lambda: pixels.view(bytes(11), "bgr", 2, 2), "11 bytes are too few for bgr of 2 x 2 pixels, 12 bytes"),
    ],
)
def test_pictures_that_cannot_be(call: object, text: str) -> None:
    with pytest.raises(PixelError, match=text):
        call()  # type: ignore[operator]
