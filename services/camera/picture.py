"""Pictures as OpenDLV shares them: ARGB (in memory B, G, R, A) and I420, always both."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


class CameraError(RuntimeError):
    """The camera gives no pictures any more; one sentence."""


@dataclass(frozen=True, eq=False)
class SharedPicture:
    """``argb`` (height, width, 4), ``i420`` (height * 3 / 2, width) and when it was taken (us since the epoch).

    A picture from a file has no time.
    """

    argb: Image
    i420: Image
    time: int | None = None


def from_i420(i420: Image, time: int | None = None) -> SharedPicture:
    """The picture of planes Y, U, V (height * 3 / 2, width), BT.601."""
    return SharedPicture(_converted(i420, cv2.COLOR_YUV2BGRA_I420), i420, time)


def from_bgr(bgr: Image, width: int, height: int, time: int | None = None) -> SharedPicture:
    """The picture of B, G, R (any height, any width, 3), scaled if it has another size."""
    if bgr.shape[:2] != (height, width):
        smaller = bgr.shape[0] * bgr.shape[1] > height * width
        bgr = np.asarray(
            cv2.resize(bgr, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
        )
    return SharedPicture(_converted(bgr, cv2.COLOR_BGR2BGRA), _converted(bgr, cv2.COLOR_BGR2YUV_I420), time)


def _converted(image: Any, code: int) -> Image:
    return np.asarray(cv2.cvtColor(image, code), np.uint8)
