"""A drive from above as a PNG, with axes.

OpenCV draws it: a plotting library takes a second to load and to draw one.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.duration_plot import round_step
from dodo_dsl.report.trajectory import DrivenPath
from dodo_dsl.terminal import printable

Colour = tuple[int, int, int]
"""Red, green and blue, from 0 to 255."""
Point = tuple[float, float]

INK, GRID = (0, 0, 0), (222, 222, 222)
_SHIFT = 4
_TICK = 5
_WEIGHT = 400
"""Of letters; 700 is bold."""
_DASH, _GAP = 6.0, 3.0


class Canvas:
    """A white picture of ``width`` and ``height`` pixels."""

    def __init__(self, width: int, height: int) -> None:
        self.pixels: NDArray[np.uint8] = np.full((height, width, 3), 255, np.uint8)
        self._font = cv2.FontFace("sans")

    def text(self, text: str, x: float, y: float, size: int, before: float = 0.5) -> None:
        """With its baseline at ``y``, and so much of it before ``x``: 0 for its start, 1 its end, 0.5 the middle."""
        place = round(x - before * self.text_width(text, size)), round(y)
        cv2.putText(self.pixels, text, place, INK, self._font, size, _WEIGHT)

    def upright(self, text: str, x: float, y: float, size: int) -> None:
        """A text that is read from below, with the middle of its baseline at a place."""
        beside = Canvas(self.text_width(text, size) + 8, 2 * size)
        beside.text(text, beside.pixels.shape[1] / 2, 1.5 * size, size)
        turned = cv2.rotate(beside.pixels, cv2.ROTATE_90_COUNTERCLOCKWISE)
        top, left = round(y - turned.shape[0] / 2), round(x - 1.5 * size)
        self.pixels[top : top + turned.shape[0], left : left + turned.shape[1]] = turned

    def text_width(self, text: str, size: int) -> int:
        """In pixels."""
        return int(cv2.getTextSize((0, 0), text, (0, 0), self._font, size, _WEIGHT)[2])

    def wrapped(self, text: str, size: int, width: float) -> Iterator[str]:
        """A text in lines of at most a width, where its words allow that."""
        line = ""
        for word in text.split():
            longer = f"{line} {word}" if line else word
            if line and self.text_width(longer, size) > width:
                yield line
                longer = word
            line = longer
        yield line

    def png(self) -> bytes:
        _, data = cv2.imencode(".png", cv2.cvtColor(self.pixels, cv2.COLOR_RGB2BGR))
        return bytes(data)


class Axes:
    """A part of a canvas with its own scale, the same in x and y; what lies outside is not drawn."""

    def __init__(self, canvas: Canvas, left: int, top: int, first: Point, last: Point, scale: float) -> None:
        """``first`` is the lower left corner and ``last`` the upper right one; ``scale`` is in pixels a unit."""
        self.canvas, self.left, self.top = canvas, left, top
        self.width, self.height = (round(scale * (b - a)) for a, b in zip(first, last, strict=True))
        self._first, self._last, self._scale = first, last, scale
        self._part: Any = canvas.pixels[top : top + self.height, left : left + self.width]

    def line(self, points: Sequence[Point], colour: Colour, width: int) -> None:
        cv2.polylines(self._part, [self._fixed(points)], False, colour, width, cv2.LINE_AA, _SHIFT)

    def dashed(self, begin: Point, end: Point, colour: Colour) -> None:
        length = math.dist(begin, end) * self._scale
        for number in range(math.ceil(length / (_DASH + _GAP))):
            parts = (number * (_DASH + _GAP), min(number * (_DASH + _GAP) + _DASH, length))
            x, y = ([a + (b - a) * part / length for part in parts] for a, b in zip(begin, end, strict=True))
            self.line(list(zip(x, y, strict=True)), colour, 1)

    def dot(self, centre: Point, radius: float, colour: Colour, edge: Colour) -> None:
        place = tuple(self._fixed([centre])[0].tolist())
        for part, size in ((edge, radius + 0.7), (colour, radius)):
            cv2.circle(self._part, place, round(size * (1 << _SHIFT)), part, cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def polygon(self, points: Sequence[Point], colour: Colour, cover: float = 0.0) -> None:
        """An outline, filled with so much of its colour."""
        if cover:
            filled = self._part.copy()
            cv2.fillPoly(filled, [self._fixed(points)], colour, cv2.LINE_AA, _SHIFT)
            cv2.addWeighted(filled, cover, self._part, 1 - cover, 0.0, dst=self._part)
        cv2.polylines(self._part, [self._fixed(points)], True, colour, 1, cv2.LINE_AA, _SHIFT)

    def grid(self, apart: float, size: int) -> None:
        """Lines at round numbers, at least so many pixels apart, and these numbers."""
        for axis in (0, 1):
            first, last = self._first[axis], self._last[axis]
            step = round_step(apart / self._scale)
            digits = max(0, -math.floor(math.log10(step) + 1e-9))
            for number in range(math.ceil(first / step), math.floor(last / step) + 1):
                self._mark(axis, number * step, f"{number * step:.{digits}f}".replace("-", "\u2212"), size)

    def frame(self) -> None:
        corner = self.left + self.width, self.top + self.height
        cv2.rectangle(self.canvas.pixels, (self.left, self.top), corner, INK, 1)

    def _mark(self, axis: int, value: float, text: str, size: int) -> None:
        place = round((value - self._first[axis]) * self._scale)
        if axis:
            y = self.top + self.height - place
            self._rule((self.left, y), (self.left + self.width, y), (self.left - _TICK, y))
            self.canvas.text(text, self.left - 2 * _TICK, y + 0.35 * size, size, before=1)
        else:
            x, y = self.left + place, self.top + self.height
            self._rule((x, y), (x, self.top), (x, y + _TICK))
            self.canvas.text(text, x, y + _TICK + 1.2 * size, size)

    def _rule(self, begin: tuple[int, int], end: tuple[int, int], tick: tuple[int, int]) -> None:
        cv2.line(self.canvas.pixels, begin, end, GRID, 1)
        cv2.line(self.canvas.pixels, begin, tick, INK, 1)

    def _fixed(self, points: Sequence[Point]) -> NDArray[np.int32]:
        scaled = (np.asarray(points, np.float64) - (self._first[0], self._last[1])) * (self._scale, -self._scale)
        limited = np.clip(scaled, -10_000.0, 10_000.0) * (1 << _SHIFT)
        return np.rint(limited).astype(np.int32)


def thinned(points: Sequence[Point], distance: float) -> list[Point]:
    """The points of a line without those that are closer to the one before; the last one stays."""
    kept = [points[0]]
    for point in points[1:-1]:
        if math.dist(kept[-1], point) >= distance:
            kept.append(point)
    return [*kept, points[-1]]


_COLOURS: dict[str, Colour] = {"passed": (26, 127, 55), "failed": (207, 34, 46), "error": (154, 103, 0)}
_GOAL, _WALL, _EDGE = (31, 111, 235), (153, 153, 153), (77, 77, 77)
_SNAPSHOT_S = 1.0
_MARGIN = 0.3
"""Around path and lines, in m."""
_SIZE = 770
"""Pixels: the width, and the height at most."""
_LEFT, _RIGHT, _BELOW, _LINE = 84, 16, 84, 18
"""Pixels around the axes, and of a line of the title."""
_LINES = 8
_TITLE, _LABEL, _LEGEND = 14, 13, 12
_TICKS = 60
"""Pixels between numbers of the axes."""
_DOT = 2.6
_CLOSE = 0.5
"""Pixels between points of the path that are worth a line."""


def draw(drive: DrivenPath, outcome: Outcome, target: Path) -> None:
    """Cones, walls and goal, the path and the vehicle's rectangle each second and at the end."""
    first, last = _corners(drive)
    wide, high = last[0] - first[0], last[1] - first[1]
    reason = printable(outcome.reason)
    lines = [f"{outcome.name}: {outcome.outcome}", *Canvas(1, 1).wrapped(reason, _TITLE, _SIZE - 2 * _RIGHT)][:_LINES]
    above = _LINE * len(lines) + 2 * _TITLE
    room = _SIZE - _LEFT - _RIGHT, max(_SIZE - above - _BELOW, _SIZE // 2)
    scale = min(room[0] / wide, room[1] / high)
    canvas = Canvas(_SIZE, above + round(scale * high) + _BELOW)
    left = (_SIZE - round(scale * wide) + _LEFT - _RIGHT) // 2
    axes = Axes(canvas, left, above, first, last, scale)
    for number, line in enumerate(lines, start=1):
        canvas.text(line, left + axes.width / 2 if len(lines) == 2 else _SIZE / 2, number * _LINE, _TITLE)
    axes.grid(_TICKS, _LABEL)
    colour = _COLOURS[outcome.outcome]
    _ground(axes, drive)
    axes.line(thinned([(x, y) for x, y, _, _ in drive.path], _CLOSE / scale), colour, 2)
    _vehicles(axes, drive, colour)
    _labels(axes, drive, colour)
    target.write_bytes(canvas.png())


def _corners(drive: DrivenPath) -> tuple[Point, Point]:
    """Lower left and upper right of path and lines; far cones may fall outside."""
    points = [(x, y) for x, y, _, _ in drive.path]
    points += [(x, y) for _, lines in drive.ground.lines for a, b, c, d in lines for x, y in ((a, b), (c, d))]
    xs, ys = zip(*points, strict=True)
    return (min(xs) - _MARGIN, min(ys) - _MARGIN), (max(xs) + _MARGIN, max(ys) + _MARGIN)


def _ground(axes: Axes, drive: DrivenPath) -> None:
    for name, lines in drive.ground.lines:
        for x1, y1, x2, y2 in lines:
            if name == drive.goal:
                axes.line([(x1, y1), (x2, y2)], _GOAL, 2)
            else:
                axes.dashed((x1, y1), (x2, y2), _WALL)
    for (red, green, blue), points in drive.ground.models:
        colour = round(255 * red), round(255 * green), round(255 * blue)
        for point in points:
            axes.dot(point, _DOT, colour, _EDGE)


def _vehicles(axes: Axes, drive: DrivenPath, colour: Colour) -> None:
    if not (drive.length and drive.width):
        return
    due = 0.0
    last = len(drive.path) - 1
    for index, (x, y, heading, when) in enumerate(drive.path):
        if when < due and index != last:
            continue
        due = when - when % _SNAPSHOT_S + _SNAPSHOT_S
        along, across = math.cos(heading), math.sin(heading)
        corners = [
            (x + along * a - across * b, y + across * a + along * b)
            for a, b in _rectangle(drive.length / 2, drive.width / 2)
        ]
        axes.polygon(corners, colour, 0.7 if index == last else 0.0)


def _rectangle(a: float, b: float) -> list[Point]:
    return [(-a, -b), (a, -b), (a, b), (-a, b)]


def _labels(axes: Axes, drive: DrivenPath, colour: Colour) -> None:
    """The frame with its names, and what the lines mean."""
    axes.frame()
    canvas, middle, bottom = axes.canvas, axes.left + axes.width // 2, axes.top + axes.height
    canvas.text("x (m)", middle, bottom + 40, _LABEL)
    canvas.upright("y (m)", axes.left - 46, axes.top + axes.height / 2, _LABEL)
    named: list[tuple[str, Colour]] = [("path", colour)]
    if any(name == drive.goal and lines for name, lines in drive.ground.lines):
        named.insert(0, (drive.goal, _GOAL))
    widths = [canvas.text_width(name, _LEGEND) + 56 for name, _ in named]
    x, y = middle - sum(widths) // 2 + 10, bottom + 68
    for (name, line), width in zip(named, widths, strict=True):
        cv2.line(canvas.pixels, (x, y - 4), (x + 26, y - 4), line, 2)
        canvas.text(name, x + 34, y, _LEGEND, before=0)
        x += width
