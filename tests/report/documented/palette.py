"""PNG files of 256 colours, a third as large as those of all colours; pages have few."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

_COLOURS = 256
_TEXT = b"Description\0\1\0\0\0"
"""Keyword, compressed, by zlib, without language and translation (PNG specification, 11.3.3.4)."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def png(picture: NDArray[np.uint8], text: str = "") -> bytes:
    """A picture (height, width, 3) of blue, green and red, in the colours that show it best, and a text about it."""
    height, width, _ = picture.shape
    rgb = picture[..., ::-1].reshape(-1, 3).astype(np.int32)
    coarse = (rgb >> 3) @ (1024, 32, 1)  # 5 bits of each: anti-aliased text has thousands of colours
    _, of, counts = np.unique(coarse, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(of.ravel(), rgb[:, channel]) for channel in range(3)], axis=1)
    means = sums / counts[:, None]
    chosen, nearest = _chosen(means, np.sqrt(counts))
    rows = nearest[of.ravel()].astype(np.uint8).reshape(height, width)
    raw = np.hstack([np.zeros((height, 1), np.uint8), rows]).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    colours = np.rint(means[chosen]).astype(np.uint8).tobytes()
    about = _TEXT + zlib.compress(text.encode(), 9)
    chunks = ((b"IHDR", header), (b"PLTE", colours), (b"iTXt", about), (b"IDAT", zlib.compress(raw, 9)), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def text_of(data: bytes) -> str:
    """The text in such a file; empty where there is none."""
    begin = data.find(b"iTXt" + _TEXT)
    return zlib.decompressobj().decompress(data[begin + 4 + len(_TEXT) :]).decode() if begin > 0 else ""


def _chosen(colours: NDArray[np.float64], weights: NDArray[np.float64]) -> tuple[list[int], NDArray[np.int64]]:
    """One colour after the other, each the farthest from those before by its weight; and the nearest of each colour."""
    chosen = [int(np.argmax(weights))]
    nearest = np.zeros(len(colours), np.int64)
    away = ((colours - colours[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < _COLOURS and (away > 0).any():
        chosen.append(int(np.argmax(away * weights)))
        now = ((colours - colours[chosen[-1]]) ** 2).sum(axis=1)
        nearest[now < away] = len(chosen) - 1
        away = np.minimum(away, now)
    return chosen, nearest


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
