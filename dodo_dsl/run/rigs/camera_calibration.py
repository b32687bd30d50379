"""Calibration of a camera: the ChArUco board in true size, and intrinsics from pictures of the board.

Intrinsics are focal length, centre and distortion, with how well they fit.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from dodo_dsl.run.rigs.axis_calibration import CalibrationProblem

COLUMNS, ROWS = 9, 6
SQUARE, MARKER = 28.0, 21.0
"""mm: 252 by 168 mm fit on A4."""
_PAPER = 297.0, 210.0
_PIXELS = 2
"""Of the drawing's raster to a mm, in which every edge of the board is whole."""


def board() -> cv2.aruco.CharucoBoard:
    """OpenCV's model of the board, in m."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE / 1000, MARKER / 1000, dictionary)


def board_picture(pixels: int = _PIXELS) -> Any:
    """The board alone in grey, with so many pixels to a mm."""
    return board().generateImage((round(COLUMNS * SQUARE * pixels), round(ROWS * SQUARE * pixels)))


def svg() -> str:
    """The board on A4 in true size, with a line of 100 mm to check that by."""
    left, top = (_PAPER[0] - COLUMNS * SQUARE) / 2, (_PAPER[1] - ROWS * SQUARE) / 2
    rectangles = "".join(
        f"M{left + x / _PIXELS:g} {top + y / _PIXELS:g}h{width / _PIXELS:g}v{height / _PIXELS:g}h{-width / _PIXELS:g}z"
        for x, y, width, height in _black(board_picture())
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


FEWEST_PICTURES, FEWEST_CORNERS = 6, 12
LARGEST_ERROR = 1.0
"""px of root mean square between seen corners and computed ones."""
LEAST_COVERED = 0.6
"""Share of the picture's width and height in which corners were seen."""
LEAST_CERTAIN = 0.01
"""Share of the focal length that its standard deviation may be."""

FEWEST_TILTED, TILTED = 3, 10.0
"""Views, and degrees by which the board is tilted in them."""
TILT = "tilt the board by 20 to 45 degrees to all sides"


@dataclass(frozen=True)
class BoardView:
    """The board in a picture of ``size`` (width, height): corners in m on the board, and in px."""

    size: tuple[int, int]
    corners: Any
    seen: Any


@dataclass(frozen=True)
class Intrinsics:
    """In px; distortion as OpenCV has it, without k3. ``fovy`` is in degrees."""

    width: int
    height: int
    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float
    k1: float
    k2: float
    p1: float
    p2: float
    error: float
    deviation: float
    """Of the focal length."""
    pictures: int

    @cached_property
    def fovy(self) -> float:
        """The vertical field of view of an ideal camera with this focal length."""
        return math.degrees(2 * math.atan(self.height / 2 / self.focal_y))


def view(picture: Any) -> BoardView | None:
    """What a picture (grey, or B, G, R) shows of the board; None for too little."""
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    model = board()
    seen, names, *_ = cv2.aruco.CharucoDetector(model).detectBoard(grey)
    if seen is None or names is None or len(names) < FEWEST_CORNERS:
        return None
    corners = np.asarray(model.getChessboardCorners(), np.float32)[np.ravel(names)]
    height, width = grey.shape[:2]
    return BoardView((width, height), corners.reshape(-1, 1, 3), np.asarray(seen, np.float32).reshape(-1, 1, 2))


def intrinsics(views: Sequence[BoardView]) -> Intrinsics:
    """From pictures of one camera; raises CalibrationProblem when they are not enough, or do not fit."""
    if len(views) < FEWEST_PICTURES:
        raise CalibrationProblem(f"{len(views)} pictures show the board, expected at least {FEWEST_PICTURES}")
    sizes = sorted({each.size for each in views})
    if len(sizes) > 1:
        said = " and ".join(f"{width} x {height}" for width, height in sizes)
        raise CalibrationProblem(f"the pictures have sizes of {said}, expected those of one camera")
    _refuse_a_corner_of_the_picture(views, sizes[0])
    try:
        error, matrix, distortion, turns, _, deviations, *_ = cv2.calibrateCameraExtended(
            [each.corners for each in views],
            [each.seen for each in views],
            sizes[0],
            np.eye(3),
            np.zeros(5),
            flags=cv2.CALIB_FIX_K3,
        )
    except cv2.error as problem:
        raise CalibrationProblem(f"the pictures give no camera: {problem.err}") from None
    k1, k2, p1, p2, *_ = map(float, np.ravel(distortion))
    deviation = float(np.ravel(deviations)[:2].max())
    focal_x, focal_y, centre_x, centre_y = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    lens = focal_x, focal_y, centre_x, centre_y, k1, k2, p1, p2
    found = Intrinsics(*sizes[0], *lens, float(error), deviation, len(views))
    if not found.error <= LARGEST_ERROR:
        text = f"corners are {found.error:.2f} px off, and {LARGEST_ERROR:g} px are allowed"
        raise CalibrationProblem(f"{text}: is the board flat, and was neither it nor the camera moving?")
    if not deviation <= LEAST_CERTAIN * found.focal_y:
        text = f"the focal length of {found.focal_y:.1f} px is uncertain by {deviation:.1f} px"
        raise CalibrationProblem(f"{text}: {TILT}")
    if (tilted := _tilted(turns)) < FEWEST_TILTED:
        text = f"the board was tilted against the others in {tilted} pictures, expected at least {FEWEST_TILTED}"
        raise CalibrationProblem(f"{text}: {TILT}")
    return found


def _tilted(turns: Sequence[Any]) -> int:
    """In how many views the board's normal is apart from the mean one: else a longer lens is a board farther away."""
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    mean = normals.mean(axis=0)
    apart = np.degrees(np.arccos(np.clip(normals @ mean / np.linalg.norm(mean), -1, 1)))
    return int((apart >= TILTED).sum())


def _refuse_a_corner_of_the_picture(views: Sequence[BoardView], size: tuple[int, int]) -> None:
    """The lens is known only where the board was."""
    seen = np.concatenate([each.seen.reshape(-1, 2) for each in views])
    shares = (seen.max(axis=0) - seen.min(axis=0)) / np.array(size)
    for share, what in zip(shares, ("width", "height"), strict=True):
        if share < LEAST_COVERED:
            text = f"the board was seen in {100 * share:.0f} % of the picture's {what}"
            raise CalibrationProblem(f"{text}, expected {100 * LEAST_COVERED:.0f} %: show it close to all edges")
