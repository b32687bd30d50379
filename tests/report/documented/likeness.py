"""Whether two pictures of pages show the same, whatever the fonts of the machine that drew them."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Place = tuple[int, ...]
"""Left, top, width and height of a part of a picture, in pixels."""

_REDUCED, _BLUR, _BLOCK = 4, 2.0, 8
"""One pixel of so many a side; the blur and the blocks are in reduced pixels."""
_C1, _C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2


MOST_UNLIKE = 0.035
"""Share of unlike blocks of two pictures that show the same: other fonts make 0.02, changed pages 0.05 and more."""
_UNLIKE = 0.5


def unlike(one: Picture, other: Picture, without: Sequence[Place] = ()) -> float:
    """The share of blocks that show something else."""
    return float((likeness(one, other, without) < _UNLIKE).mean())


def likeness(one: Picture, other: Picture, without: Sequence[Place] = ()) -> NDArray[np.float64]:
    """The structural similarity of each block, 1 for the same; ``without`` are places that are not compared.

    Wang, Bovik, Sheikh, Simoncelli: Image quality assessment, IEEE Transactions on Image Processing 13, 2004.
    """
    assert one.shape == other.shape, f"{one.shape[1::-1]} and {other.shape[1::-1]} pixels"
    x, y = (_reduced(picture, without) for picture in (one, other))
    mean_x, mean_y = _blurred(x), _blurred(y)
    var_x, var_y = _blurred(x * x) - mean_x**2, _blurred(y * y) - mean_y**2
    both = _blurred(x * y) - mean_x * mean_y
    found = (2 * mean_x * mean_y + _C1) * (2 * both + _C2) / ((mean_x**2 + mean_y**2 + _C1) * (var_x + var_y + _C2))
    size = (found.shape[1] // _BLOCK, found.shape[0] // _BLOCK)
    return np.asarray(cv2.resize(found.mean(axis=2), size, interpolation=cv2.INTER_AREA), np.float64)


def _reduced(picture: Picture, without: Sequence[Place]) -> NDArray[np.float64]:
    shown = picture.copy()
    for left, top, width, height in without:
        shown[max(0, top) : top + height, max(0, left) : left + width] = 128
    size = (shown.shape[1] // _REDUCED, shown.shape[0] // _REDUCED)
    return cv2.resize(shown, size, interpolation=cv2.INTER_AREA).astype(np.float64)


def _blurred(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), _BLUR), np.float64)
