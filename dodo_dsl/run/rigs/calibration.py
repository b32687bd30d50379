"""Calibration of a rig: the line through the readings of an axis, and a camera's intrinsics by frames of a board."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

FEWEST = 4
"""Readings of an axis: three that fit show which fourth one does not."""
CIRCLE_STEPS = 200 / 360
"""Full steps a degree of a yaw that turns without end, of which only the offset is measured."""


class CalibrationProblem(Exception):
    """Measurements from which nothing can be computed, or not well enough; one sentence."""


@dataclass(frozen=True)
class Axis:
    """An axis; positions are in ``unit``, shown in ``small`` units of which ``per`` make one.

    A residual may have ``tolerance`` (unit), and readings have to span ``span`` (unit). Constants are written with
    ``digits`` decimals.
    """

    name: str
    unit: str
    small: str
    per: float
    tolerance: float
    span: float
    digits: int
    circle: bool = False

    @property
    def density(self) -> str:
        """The unit of its steps."""
        return f"steps/{self.unit}"

    def shown(self, position: float, sign: str = "") -> str:
        """A position, or a difference of two, as a ruler or protractor shows it."""
        return f"{position * self.per + 0.0:{sign}.2f} {self.small}"


def axes(circle: bool) -> dict[str, Axis]:
    """The axes of a kind of rig."""
    lengths = {name: Axis(name, "m", "mm", 1000.0, 0.001, 0.3, 4) for name in ("x", "y")}
    return {**lengths, "yaw": Axis("yaw", "deg", "deg", 1.0, 0.5, 60.0, 7, circle)}


@dataclass(frozen=True)
class Reading:
    """The counters' full steps from home, and the true position that was read (m, degrees)."""

    steps: float
    position: float


@dataclass(frozen=True)
class AxisLine:
    """steps = ``steps`` * position + ``offset``, with standard errors; residuals are read minus computed positions."""

    steps: float
    offset: float
    steps_error: float
    offset_error: float
    residuals: Sequence[float]


class ReadingOff(CalibrationProblem):
    """A reading that the others contradict; ``index`` is its place."""

    def __init__(self, text: str, index: int) -> None:
        super().__init__(text)
        self.index = index


def fit(axis: Axis, readings: Sequence[Reading]) -> AxisLine:
    """The line with the least squares of differences between read and computed positions.

    Raises CalibrationProblem for readings that are too close, and ReadingOff for a residual beyond the axis' tolerance.
    """
    steps, places = np.array([(reading.steps, reading.position) for reading in readings]).T
    if (spread := np.ptp(places)) < axis.span:
        text = f"the readings of {axis.name} span {axis.shown(spread)}, expected at least {axis.shown(axis.span)}"
        raise CalibrationProblem(text)
    if len({*steps}) < FEWEST:
        raise CalibrationProblem(f"the readings of {axis.name} are at fewer than {FEWEST} different places")
    line, leverage = _turn(steps, places) if axis.circle else _straight(steps, places)
    if np.abs(line.residuals).max() > axis.tolerance:
        index = int((np.square(line.residuals) / (1 - leverage)).argmax())  # without it the others fit best
        apart = line.residuals[index] / (1 - leverage[index])
        where = f"reading {index + 1}, {axis.shown(places[index])} at {steps[index]:.2f} steps,"
        off = f"is {axis.shown(apart, '+')} off the line of the others"
        raise ReadingOff(f"{axis.name}: {where} {off}, and {axis.shown(axis.tolerance)} are allowed", index)
    return line


def _straight(steps: Any, places: Any) -> tuple[AxisLine, Any]:
    (slope, level), covariance = np.polyfit(steps, places, 1, cov=True)
    if slope <= 0:
        raise CalibrationProblem("positions fall while steps rise: is the sign of the readings wrong?")
    offset, gradient = -level / slope, np.array([level / slope**2, -1 / slope])
    errors = math.sqrt(covariance[0, 0]) / slope**2, math.sqrt(gradient @ covariance @ gradient)
    middle = steps - steps.mean()
    line = AxisLine(1 / slope, offset, *errors, places - slope * steps - level)
    return line, 1 / len(steps) + middle**2 / (middle @ middle)


def _turn(steps: Any, places: Any) -> tuple[AxisLine, Any]:
    """The offset alone; a heading may have any of its names."""
    shifts = places - steps / CIRCLE_STEPS
    apart = (shifts - shifts[0] + 180) % 360 - 180
    offset = -(shifts[0] + apart.mean()) * CIRCLE_STEPS % (360 * CIRCLE_STEPS)
    error = apart.std(ddof=1) * CIRCLE_STEPS / math.sqrt(len(apart))
    return AxisLine(CIRCLE_STEPS, offset, 0.0, error, apart - apart.mean()), np.full(len(apart), 1 / len(apart))


COLUMNS, ROWS = 9, 6
SQUARE, MARKER = 28.0, 21.0
"""mm, of the board in docs/rigs/board.svg."""
FEWEST_CORNERS = 12
LARGEST_ERROR = 1.0
"""px of root mean square between seen corners and computed ones."""
LEAST_COVERED = 0.6
"""Share of the frame's width and height in which corners were seen."""
LEAST_CERTAIN = 0.01
"""Share of the focal length that its standard deviation may be."""


@dataclass(frozen=True)
class BoardView:
    """The board in a frame of ``size`` (width, height): corners in m on the board, and in px."""

    size: tuple[int, int]
    corners: Any
    seen: Any


def board() -> Any:
    """OpenCV's model of the board, in m."""
    from cv2 import aruco  # OpenCV takes a second to import

    dictionary = aruco.getPredefinedDictionary(aruco.DICT_5X5_100)
    return aruco.CharucoBoard((COLUMNS, ROWS), SQUARE / 1000, MARKER / 1000, dictionary)


def view(frame: Any) -> BoardView | None:
    """What a grey frame shows of the board; None for too little."""
    from cv2 import aruco

    model = board()
    seen, names, *_ = aruco.CharucoDetector(model).detectBoard(frame)
    if seen is None or names is None or len(names) < FEWEST_CORNERS:
        return None
    corners = np.asarray(model.getChessboardCorners(), np.float32)[np.ravel(names)]
    height, width = frame.shape
    return BoardView((width, height), corners.reshape(-1, 1, 3), np.asarray(seen, np.float32).reshape(-1, 1, 2))


def intrinsics(views: Sequence[BoardView]) -> dict[str, float]:
    """By the names of ``camera.intrinsics`` in dodo.yml, in px and degrees; distortion is OpenCV's, without k3.

    Raises CalibrationProblem for frames that are not enough, or do not fit.
    """
    import cv2

    size = views[0].size
    seen = np.concatenate([each.seen.reshape(-1, 2) for each in views])
    for share, what in zip(np.ptp(seen, axis=0) / size, ("width", "height"), strict=True):
        if share < LEAST_COVERED:
            text = f"the board was seen in {100 * share:.0f} % of the frame's {what}"
            raise CalibrationProblem(f"{text}, expected {100 * LEAST_COVERED:.0f} %: show it close to all edges")
    try:
        error, matrix, distortion, _, _, deviations, *_ = cv2.calibrateCameraExtended(
            [each.corners for each in views], [each.seen for each in views], size,
            np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3,
        )  # fmt: skip
    except cv2.error as problem:
        raise CalibrationProblem(f"the frames give no camera: {problem.err}") from None
    if not error <= LARGEST_ERROR:
        text = f"corners are {error:.2f} px off, and {LARGEST_ERROR:g} px are allowed"
        raise CalibrationProblem(f"{text}: is the board flat, and was neither it nor the camera moving?")
    focal, deviation = float(matrix[1, 1]), float(np.ravel(deviations)[:2].max())
    if not deviation <= LEAST_CERTAIN * focal:
        text = f"the focal length of {focal:.1f} px is uncertain by {deviation:.1f} px"
        raise CalibrationProblem(f"{text}: tilt the board by 20 to 45 degrees to all sides")
    found = {"width": size[0], "height": size[1], "focal-x": float(matrix[0, 0]), "focal-y": focal}
    found |= {"centre-x": float(matrix[0, 2]), "centre-y": float(matrix[1, 2])}
    found["fovy"] = math.degrees(2 * math.atan(size[1] / 2 / focal))
    return (
        found | dict(zip(("k1", "k2", "p1", "p2"), map(float, np.ravel(distortion)), strict=False)) | {"error": error}
    )
