"""What a sensor makes of a picture: exposure, noise and gain.

Pictures hold values that are encoded for display (a gamma of 2.2): twice the light is a value 2^(1/2.2) times as large.
A value v becomes G (E v + n), cut off at 0 and 255, with E and G the encoded exposure and gain, and n the noise.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from services.scene.draw.raster import Image

GAMMA = 2.2
_POOL = 1 << 19


@dataclass(frozen=True)
class Sensor:
    """``exposure`` and ``gain`` are factors of light, 1 as drawn; ``noise`` is a standard deviation, 1 the full scale.

    The noise is Gaussian, independent in each colour of each pixel; ``seed`` and the picture's time decide it.
    """

    exposure: float = 1.0
    gain: float = 1.0
    noise: float = 0.0
    seed: int = 0

    def table(self, factor: float) -> Image:
        """Values (1, 256, 4) for each value of a colour after so much more light; alpha stays."""
        values = np.arange(256.0)
        brighter = np.minimum(np.rint(values * factor ** (1 / GAMMA)), 255.0)
        return np.stack([brighter, brighter, brighter, values], axis=-1).astype(np.uint8)[None]


class Development:
    """Applies a sensor to pictures, in place."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._exposure = sensor.table(sensor.exposure) if sensor.exposure != 1.0 else None
        self._gain = sensor.table(sensor.gain) if sensor.gain != 1.0 else None
        self._pools = _pools(sensor) if sensor.noise > 0.0 else None

    def develop(self, picture: Image, sample_time: int) -> None:
        """Changes a picture (height, width, 4) that was sampled at ``sample_time`` us."""
        if self._exposure is not None:
            cv2.LUT(picture, self._exposure, dst=picture)
        if self._pools is not None:
            rows = self._rows(picture.shape, sample_time)
            cv2.add(picture, _taken(self._pools[0], rows, picture.shape), dst=picture)
            cv2.subtract(picture, _taken(self._pools[1], rows, picture.shape), dst=picture)
        if self._gain is not None:
            cv2.LUT(picture, self._gain, dst=picture)

    def _rows(self, shape: tuple[int, ...], sample_time: int) -> npt.NDArray[np.intp]:
        """For each row of a picture the pixel of the pool where its noise begins, drawn by lot."""
        height, width = shape[:2]
        random = np.random.RandomState([self._sensor.seed, sample_time & 0xFFFFFFFF, sample_time >> 32 & 0xFFFFFFFF])
        return random.randint(0, _POOL - width + 1, height)


def _pools(sensor: Sensor) -> tuple[Image, Image]:
    """Noise for so many pixels (n, 4), none in alpha: what it adds, and what it takes away."""
    random = np.random.RandomState([2903, sensor.seed])
    pool = np.zeros((_POOL, 4), np.int16)
    pool[:, :3] = np.rint(random.standard_normal((_POOL, 3)) * (sensor.noise * 255.0))
    return np.clip(pool, 0, 255).astype(np.uint8), np.clip(-pool, 0, 255).astype(np.uint8)


def _taken(pool: Image, rows: npt.NDArray[np.intp], shape: tuple[int, ...]) -> Image:
    """A picture whose rows are those pieces of the pool."""
    pieces = np.lib.stride_tricks.sliding_window_view(pool.reshape(-1), shape[1] * 4)[::4]
    return pieces[rows].reshape(shape)
