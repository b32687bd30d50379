import numpy as np
import pytest

from services.camera.picture import from_bgr, from_i420


def test_colours_are_in_the_order_of_argb_and_planes() -> None:
    picture = from_bgr(np.full((2, 4, 3), (255, 0, 0), np.uint8), 4, 2, 7)
    assert picture.argb.shape == (2, 4, 4) and picture.argb[0, 0].tolist() == [255, 0, 0, 255]
    assert picture.i420.shape == (3, 4) and picture.time == 7
    assert picture.i420[:2].mean() == pytest.approx(41, abs=1)  # BT.601: blue is Y 41, U 240, V 110
    assert picture.i420[2].tolist() == pytest.approx([240, 240, 110, 110], abs=1)


def test_the_way_back_from_planes() -> None:
    i420 = from_bgr(np.full((4, 4, 3), (30, 90, 200), np.uint8), 4, 4).i420
    picture = from_i420(i420, 3)
    assert picture.i420 is i420 and picture.time == 3
    assert picture.argb[1, 1].tolist() == pytest.approx([30, 90, 200, 255], abs=3)


@pytest.mark.parametrize("size", [(8, 8), (64, 48)])
def test_another_size_is_scaled(size: tuple[int, int]) -> None:
    image = np.zeros((24, 32, 3), np.uint8)
    image[:, 16:] = 200
    picture = from_bgr(image, *size)
    assert picture.argb.shape == (size[1], size[0], 4)
    assert (picture.argb[0, 0, 0], picture.argb[0, -1, 0]) == (0, 200)
