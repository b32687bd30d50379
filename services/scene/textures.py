"""Textures as pyramids of ever coarser pictures, already repeated so that warping needs no wrapping."""

from pathlib import Path

import cv2
import numpy as np

from dodo_dsl.opendlv.assets.json_file import read_bytes
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.picture_size import problem_of
from services.scene.raster import Image

MAX_TILE = 1024
CANVAS = 2048
_COARSEST = 8


def with_alpha(picture: Image) -> Image:
    """B, G, R as B, G, R, A, opaque."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2BGRA), np.uint8)


def halved(picture: Image) -> Image:
    """Half as wide and high, rounded up, each new pixel the mean of those it covers."""
    height, width = picture.shape[:2]
    size = ((width + 1) // 2, (height + 1) // 2)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


class Texture:
    """A tile that repeats endlessly; level n of the pyramid has 2^n times less resolution.

    ``tiles`` holds the tile of each level (rows, columns, 4), ``canvases`` the same tiles repeated
    to about 2048 pixels, though not beyond ``repeats`` whole tiles and two more.
    """

    def __init__(self, picture: Image, repeats: int = CANVAS) -> None:
        while max(picture.shape[:2]) > MAX_TILE:
            picture = halved(picture)
        self.tiles = [with_alpha(picture)]
        while max(self.tiles[-1].shape[:2]) > _COARSEST:
            self.tiles.append(halved(self.tiles[-1]))
        self.canvases = [_repeated(tile, repeats + 2) for tile in self.tiles]
        self.mean = tuple(float(part) for part in picture.reshape(-1, 3).mean(axis=0))
        """The mean colour: blue, green, red."""

    @property
    def size(self) -> int:
        """Bytes of memory."""
        return sum(picture.nbytes for picture in (*self.tiles, *self.canvases))


def _repeated(tile: Image, limit: int) -> Image:
    down, across = (min(limit, -(-CANVAS // size)) for size in tile.shape[:2])
    return np.tile(tile, (down, across, 1))


def load_picture(path: Path, flags: int = cv2.IMREAD_COLOR) -> Image:
    """A PNG or JPEG file as OpenCV's ``flags`` have it, B, G, R by default; raises InputError."""
    data = read_bytes(path)
    if problem := problem_of(data):
        raise InputError(path, problem)
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise InputError(path, f"the picture cannot be read: {error.err}") from error
    if picture is None or picture.dtype != np.uint8:
        raise InputError(path, "not a picture with 8 bits per colour, expected PNG or JPEG")
    return np.asarray(picture, np.uint8)


def default_ground() -> Image:
    """The ground of a map without blocks: a square metre of grey with a fine grain, flecks and a grid."""
    size = 256
    noise = np.random.RandomState(2901)
    grain = noise.randint(-9, 10, (size, size))
    coarse = noise.randint(-7, 8, (size // 16, size // 16)).repeat(16, axis=0).repeat(16, axis=1)
    grey = 118 + grain + coarse
    grey[: size // 64] -= 26
    grey[:, : size // 64] -= 26
    return np.repeat(grey[:, :, None], 3, axis=2).astype(np.uint8)
