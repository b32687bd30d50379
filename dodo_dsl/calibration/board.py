"""The ChArUco board that a camera looks at: what OpenCV knows of it, and its drawing in true size."""

import itertools
from typing import Any

import cv2
import numpy as np

COLUMNS, ROWS = 9, 6
SQUARE, MARKER = 28.0, 21.0
"""mm: 252 by 168 mm fit on A4."""
_PAPER = 297.0, 210.0
_PIXELS = 2
"""Of the drawing's raster to a mm, in which every edge of the board is whole."""


def board() -> cv2.aruco.CharucoBoard:
    """OpenCV's model of it, in m."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE / 1000, MARKER / 1000, dictionary)


def picture(pixels: int = _PIXELS) -> Any:
    """The board alone in grey, with so many pixels to a mm."""
    return board().generateImage((round(COLUMNS * SQUARE * pixels), round(ROWS * SQUARE * pixels)))


def svg() -> str:
    """The board on A4 in true size, with a line of 100 mm to check that by."""
    left, top = (_PAPER[0] - COLUMNS * SQUARE) / 2, (_PAPER[1] - ROWS * SQUARE) / 2
    rectangles = "".join(
        f"M{left + x / _PIXELS:g} {top + y / _PIXELS:g}h{width / _PIXELS:g}v{height / _PIXELS:g}h{-width / _PIXELS:g}z"
        for x, y, width, height in _black(picture())
    )
    width, height = _PAPER
    foot = height - 12
    text = (
        f"{COLUMNS} x {ROWS} squares of {SQUARE:g} mm. Print without scaling: the line above is 100 mm. "
        "Glue it onto something flat."
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
        f'viewBox="0 0 {width:g} {height:g}">\n'
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>\n'
        f'<path d="{rectangles}"/>\n'
        f'<path d="M{left:g} {foot:g}h100m-100 -1v2m100 -2v2" stroke="#000" stroke-width="0.3"/>\n'
        f'<text x="{left:g}" y="{foot + 6:g}" font-family="sans-serif" font-size="4">{text}</text>\n'
        "</svg>\n"
    )


def _black(raster: Any) -> list[tuple[int, int, int, int]]:
    """Black rectangles (x, y, width, height): runs of rows that are the same below one another."""
    found = []
    changes = [0, *(np.flatnonzero((raster[1:] != raster[:-1]).any(axis=1)) + 1).tolist(), len(raster)]
    for y, end in itertools.pairwise(changes):
        row = np.concatenate([[255], raster[y], [255]]).astype(np.int16)
        edges = np.flatnonzero(np.diff(row)).tolist()
        found += [(x, y, last - x, end - y) for x, last in zip(edges[::2], edges[1::2], strict=True)]
    return found
