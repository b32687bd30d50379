"""Pictures that the map lays over the camera's, such as a part of the vehicle that is always seen."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from dodo_dsl.opendlv.inputs.json_node import MapError
from dodo_dsl.opendlv.inputs.map_file import OverlayEntry
from services.scene.draw.raster import Image
from services.scene.map.textures import picture_bytes


def load_with_alpha(path: Path) -> Image:
    """A picture file as (rows, columns, 4), B, G, R, A, opaque where it has no alpha; MapError otherwise."""
    data = picture_bytes(path)
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        picture = None
    if picture is None or picture.dtype != np.uint8:
        raise MapError(path, "not a picture with 8 bits per colour, expected PNG or JPEG")
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
    """All overlays of a map, for pictures of ``width`` and ``height`` pixels; raises MapError."""
    for entry in entries:
        wide, high = max(1, round(entry.size[0] * width)), max(1, round(entry.size[1] * height))
        picture = cv2.resize(load_with_alpha(entry.file), (wide, high), interpolation=cv2.INTER_AREA)
        for x, y in entry.places:
            yield Overlay(np.asarray(picture, np.uint8), round(x * width), round(y * height), (width, height))
