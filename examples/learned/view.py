"""What the learned driver sees of a frame: where yellow and blue are, coarsely."""

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

COLUMNS, ROWS = 32, 12
HORIZON = 0.5  # nothing above it shows where the track is
SEEN = 0.05  # share of a cell that a colour takes, beyond which more of it changes little


def view(picture: MatLike) -> NDArray[np.float64]:
    """The frame (blue, green, red, perhaps alpha) as 2 x ROWS x COLUMNS numbers from 0 to 1, and a 1.

    A cell of the lower half has how yellow it is, and how blue.
    """
    ground = picture[int(HORIZON * picture.shape[0]) :, :, :3].astype(np.float32)
    blue, green, red = cv2.split(ground)
    brightness = np.maximum(ground.max(axis=2), 1.0)
    yellowness = np.clip((np.minimum(green, red) - blue) / brightness - 0.3, 0, 1)
    blueness = np.clip((blue - np.maximum(green, red)) / brightness - 0.3, 0, 1)
    cells = [cv2.resize(one, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA) for one in (yellowness, blueness)]
    seen = [np.minimum(cell / SEEN, 1.0).ravel() for cell in cells]
    return np.concatenate([*seen, [1.0]]).astype(np.float64)
