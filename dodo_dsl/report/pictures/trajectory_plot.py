"""A drive from above as a PNG."""

import math
from pathlib import Path

import cv2

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.pictures.canvas import Axes, Canvas, Colour, Point, thinned
from dodo_dsl.report.pictures.trajectory import DrivenPath
from dodo_dsl.terminal import printable

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
