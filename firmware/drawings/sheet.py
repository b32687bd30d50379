"""A drawing as SVG: lines, circles, texts and measures in the coordinates of the thing, y (or z) upwards."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

Point = tuple[float, float]
_ARROW = 5.0
_FONT = 12


def mm(value: float) -> str:
    """A number as a drawing shows it."""
    return f"{round(value, 1) + 0.0:g}"


@dataclass
class Sheet:
    """``width`` and ``height`` in pixels, ``scale`` pixels to a unit; ``origin`` is where (0, 0) is on the sheet."""

    width: float
    height: float
    scale: float
    origin: Point
    _parts: list[str] = field(default_factory=list)

    def at(self, point: Point) -> Point:
        return self.origin[0] + point[0] * self.scale, self.origin[1] - point[1] * self.scale

    def path(self, points: Sequence[Point], style: str = "", closed: bool = False) -> None:
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.at, points))
        self._parts.append(f'<{"polygon" if closed else "polyline"} points="{places}" {style}/>')

    def box(self, low: Point, high: Point, style: str = "") -> None:
        self.path([low, (high[0], low[1]), high, (low[0], high[1])], style, closed=True)

    def circle(self, middle: Point, radius: float, style: str = "") -> None:
        x, y = self.at(middle)
        self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius * self.scale:.1f}" {style}/>')

    def arc(self, radius: float, begin: float, end: float, style: str = "") -> None:
        """Around (0, 0), counter-clockwise, in degrees."""
        count = max(2, round(abs(end - begin) / 3))
        angles = [math.radians(begin + (end - begin) * step / count) for step in range(count + 1)]
        self.path([(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles], style)

    def text(
        self, point: Point, words: str, shift: Point = (0, 0), anchor: str = "start", turned: bool = False
    ) -> None:
        """``shift`` in pixels, to the right and down."""
        x, y = self.at(point)
        x, y = x + shift[0], y + shift[1]
        turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
        place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{turn}'
        self._parts.append(f'<text {place} stroke="none" fill="#000">{html.escape(words)}</text>')

    def across(self, left: float, right: float, at: float, words: str, reach: Sequence[float] = ()) -> None:
        """A measure along x at height ``at``; thin lines lead from the heights of ``reach`` to it."""
        self._measure(
            (left, at), (right, at), words, [((x, y), (x, at)) for x, y in zip((left, right), reach, strict=False)]
        )

    def up(self, low: float, high: float, at: float, words: str, reach: Sequence[float] = ()) -> None:
        """A measure along y at ``at``."""
        self._measure(
            (at, low), (at, high), words, [((x, y), (at, y)) for y, x in zip((low, high), reach, strict=False)]
        )

    def _measure(self, begin: Point, end: Point, words: str, helpers: list[tuple[Point, Point]]) -> None:
        for helper in helpers:
            self.path(helper, 'stroke-width="0.5" stroke="#555"')
        self.path([begin, end], 'stroke-width="0.7" marker-start="url(#end)" marker-end="url(#end)"')
        middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
        upright = begin[0] == end[0]
        self.text(middle, words, (-4, 0) if upright else (0, -4), "middle", upright)

    def svg(self) -> str:
        """The whole file; white, so that it can be read on a dark page, too."""
        size = f'width="{self.width:g}" height="{self.height:g}" viewBox="0 0 {self.width:g} {self.height:g}"'
        arrow = f'<path d="M0 0L{2 * _ARROW:g} {_ARROW / 2:g}L0 {_ARROW:g}z" fill="#000" stroke="none"/>'
        marker = (
            f'<marker id="end" markerUnits="userSpaceOnUse" markerWidth="{2 * _ARROW:g}" markerHeight="{_ARROW:g}" '
            f'refX="{2 * _ARROW:g}" refY="{_ARROW / 2:g}" orient="auto-start-reverse">{arrow}</marker>'
        )
        return "\n".join(
            [
                f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="{_FONT}" '
                'fill="none" stroke="#000">',
                f"<defs>{marker}</defs>",
                '<rect width="100%" height="100%" fill="#fff" stroke="none"/>',
                *self._parts,
                "</svg>\n",
            ]
        )
