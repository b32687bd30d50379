"""From what passes before a camera to the picture that it gives: shutter, lens, overlays and sensor, in this order.

Overlays are pictures that the map lays over the camera's, such as a part of the vehicle that is always seen. A sensor
has exposure, noise and gain. Pictures hold values that are encoded for display (a gamma of 2.2): twice the light is a
value 2^(1/2.2) times as large. A value v becomes G (E v + n), cut off at 0 and 255, with E and G the encoded exposure
and gain, and n the noise.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import OverlayEntry
from services.scene.camera import CameraMotion, CameraPose, Pinhole
from services.scene.lens import Lens
from services.scene.raster import Image
from services.scene.render import Renderer
from services.scene.textures import load_picture


def load_with_alpha(path: Path) -> Image:
    """A picture file as (rows, columns, 4), B, G, R, A, opaque if it has no alpha; InputError otherwise."""
    picture = load_picture(path, cv2.IMREAD_UNCHANGED)
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    codes = {1: cv2.COLOR_GRAY2BGRA, 3: cv2.COLOR_BGR2BGRA}
    return np.asarray(cv2.cvtColor(picture, codes[channels]) if channels in codes else picture, np.uint8)


class Overlay:
    """A picture at a place of pictures of one size."""

    def __init__(self, picture: Image, left: int, top: int, size: tuple[int, int]) -> None:
        """``left`` and ``top`` of its corner, in pixels; ``size`` (width, height) of what it is laid over."""
        right, bottom = min(left + picture.shape[1], size[0]), min(top + picture.shape[0], size[1])
        first, above = max(left, 0), max(top, 0)
        self._window = slice(above, max(bottom, above)), slice(first, max(right, first))
        part = picture[above - top : max(bottom, above) - top, first - left : max(right, first) - left]
        alpha = part[..., 3:].astype(np.float64) / 255.0
        colours = np.rint(part[..., :3] * alpha)
        self._own = np.concatenate([colours, np.zeros_like(alpha)], axis=-1).astype(np.uint8)
        left_over = np.rint(255.0 * (1.0 - alpha))
        self._rest = np.concatenate([left_over] * 3 + [np.full_like(alpha, 255.0)], axis=-1).astype(np.uint8)

    def lay(self, picture: Image) -> None:
        """Blends the overlay into a picture (height, width, 4)."""
        window = picture[self._window]
        if window.size:
            dimmed = cv2.multiply(window, self._rest, scale=1 / 255)
            cv2.add(dimmed, self._own, dst=window)


def load_overlays(entries: tuple[OverlayEntry, ...], width: int, height: int) -> Iterator[Overlay]:
    """All overlays of a map, for pictures of ``width`` and ``height`` pixels; raises InputError."""
    for entry in entries:
        wide, high = max(1, round(entry.dimension[0] * width)), max(1, round(entry.dimension[1] * height))
        picture = cv2.resize(load_with_alpha(entry.texture_file), (wide, high), interpolation=cv2.INTER_AREA)
        for x, y, *_ in entry.instances:
            yield Overlay(np.asarray(picture, np.uint8), round(x * width), round(y * height), (width, height))


GAMMA = 2.2
_POOL = 1 << 19


class Sensor:
    """``exposure`` and ``gain`` are factors of light, 1 as drawn; ``noise`` is a standard deviation, 1 the full scale.

    The noise is Gaussian, independent in each colour of each pixel; ``seed`` and the picture's time decide it.
    """

    def __init__(self, exposure: float = 1.0, gain: float = 1.0, noise: float = 0.0, seed: int = 0) -> None:
        self._exposure = _table(exposure) if exposure != 1.0 else None
        self._gain = _table(gain) if gain != 1.0 else None
        self._pools = _pools(noise, seed) if noise > 0.0 else None
        self._seed = seed

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
        random = np.random.RandomState([self._seed, sample_time & 0xFFFFFFFF, sample_time >> 32 & 0xFFFFFFFF])
        return random.randint(0, _POOL - width + 1, height)


def _table(factor: float) -> Image:
    """Values (1, 256, 4) for each value of a colour after so much more light; alpha stays."""
    values = np.arange(256.0)
    brighter = np.minimum(np.rint(values * factor ** (1 / GAMMA)), 255.0)
    return np.stack([brighter, brighter, brighter, values], axis=-1).astype(np.uint8)[None]


def _pools(noise: float, seed: int) -> tuple[Image, Image]:
    """Noise for so many pixels (n, 4), none in alpha: what it adds, and what it takes away."""
    random = np.random.RandomState([2903, seed])
    pool = np.zeros((_POOL, 4), np.int16)
    pool[:, :3] = np.rint(random.standard_normal((_POOL, 3)) * (noise * 255.0))
    return np.clip(pool, 0, 255).astype(np.uint8), np.clip(-pool, 0, 255).astype(np.uint8)


def _taken(pool: Image, rows: npt.NDArray[np.intp], shape: tuple[int, ...]) -> Image:
    """A picture whose rows are those pieces of the pool."""
    pieces = np.lib.stride_tricks.sliding_window_view(pool.reshape(-1), shape[1] * 4)[::4]
    return pieces[rows].reshape(shape)


class Optics:
    """Everything behind the scene that makes pictures of ``camera``; what is left out is ideal."""

    def __init__(
        self,
        camera: Pinhole,
        lens: Lens | None = None,
        sensor: Sensor | None = None,
        overlays: Sequence[Overlay] = (),
        shutter: float = 0.0,
    ) -> None:
        """``shutter`` is open for so many seconds."""
        self.camera, self.lens = camera, lens
        self.wide = lens.wide if lens else camera
        """What a renderer has to draw."""
        self._overlays, self._shutter = overlays, shutter
        self._sensor = sensor or Sensor()
        shape = (self.wide.height, self.wide.width, 4)
        self._ideal = np.empty(shape, np.uint8)
        self._sums = np.empty((2, *shape), np.uint16) if shutter > 0.0 else None

    def expose(
        self, renderer: Renderer, motion: CameraMotion, mounted: CameraPose, sample_time: int, out: Image
    ) -> None:
        """The picture (height, width, 4) at ``sample_time`` us of a camera ``mounted`` on a body in ``motion``.

        The shutter is open half its time before that and half after it.
        """
        ideal = self._ideal if self.lens else out
        steps = motion.steps(self.wide, self._shutter)
        if self._sums is None or steps == 1:
            renderer.render(motion.pose.carrying(mounted), ideal)
        else:
            self._blend(renderer, motion, mounted, steps, self._sums, ideal)
        if self.lens:
            self.lens.apply(ideal, out)
        for overlay in self._overlays:
            overlay.lay(out)
        self._sensor.develop(out, sample_time)

    def _blend(
        self,
        renderer: Renderer,
        motion: CameraMotion,
        mounted: CameraPose,
        steps: int,
        sums: npt.NDArray[np.uint16],
        ideal: Image,
    ) -> None:
        """The mean of ``steps`` pictures while the shutter is open, that of the middle of it drawn whole."""
        poses = [motion.after(((step + 0.5) / steps - 0.5) * self._shutter).carrying(mounted) for step in range(steps)]
        middle = poses.pop(steps // 2)
        total, wide = sums
        total.fill(0)
        for picture in renderer.render_around(middle, poses, ideal):
            np.copyto(wide, picture)  # as to add numbers of two sizes takes longer
            cv2.add(total, wide, dst=total)
        cv2.convertScaleAbs(total, dst=ideal, alpha=1 / steps)
