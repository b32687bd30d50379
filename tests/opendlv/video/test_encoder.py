import numpy as np
import pytest

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.video import VideoDecoder, VideoEncoder, VideoError, has_key_frame

WIDTH, HEIGHT = 84, 46  # no multiple of 16, so that rows are padded


def noise(kind: str, number: int) -> pixels.Picture:
    data = np.random.default_rng(number).integers(0, 256, pixels.size(kind, WIDTH, HEIGHT), np.uint8)
    picture = pixels.view(data, kind, WIDTH, HEIGHT)
    if kind == "argb":
        picture[..., 3] = 255
    return picture


def smooth(number: int) -> pixels.Picture:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return pixels.converted(np.dstack([x + number, 2 * y, x + y]).astype(np.uint8), "bgr", "i420")


@pytest.mark.parametrize("kind", pixels.FORMATS)
def test_lossless_packets_give_back_the_same_bytes(kind: str) -> None:
    encoder, decoder = VideoEncoder(kind, WIDTH, HEIGHT, lossless=True), VideoDecoder("h264")
    for number in range(12):
        picture = noise(kind, number)
        frame = decoder.decode(encoder.encode(picture))
        assert frame is not None
        assert (frame.pixels(kind) == picture).all()


def test_every_so_many_pictures_one_stands_alone() -> None:
    encoder = VideoEncoder("i420", WIDTH, HEIGHT, key_interval=4)
    assert [has_key_frame(encoder.encode(smooth(n))) for n in range(9)] == [n % 4 == 0 for n in range(9)]


def test_lossy_packets_are_of_the_baseline_profile() -> None:
    packet = VideoEncoder("argb", WIDTH, HEIGHT).encode(noise("argb", 1))
    assert packet[:4] == b"\0\0\0\1"
    assert (packet[4] & 31, packet[5]) == (7, 66)  # a sequence parameter set of profile 66


@pytest.mark.parametrize("size", [(641, 480), (640, 481), (0, 0)])
def test_sizes_that_h264_cannot_have(size: tuple[int, int]) -> None:
    with pytest.raises(VideoError, match="h264 needs an even width and height, not"):
        VideoEncoder("argb", *size)
