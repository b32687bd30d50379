"""A drive from above as a small SVG: lines of the map, its cones, the path and where it ended.

Pages put it inline, so that it follows their colours. Because a report is untrusted, only what this module
could have written is put there.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from markupsafe import Markup

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.trajectory import DrivenPath, Point

FILE_NAME = "trajectory.svg"
Place = Callable[[Point], tuple[int, int]]
"""From metres to units of the picture."""
_WIDTH, _HEIGHT, _PAD = 240, 180, 8
"""Units of the picture at most, and around what it shows."""
_TALL = 1.5
_MOST_LINES = 300
_CLOSE, _MOST_POINTS, _MOST_CONES = 6.0, 50, 40
_MOST_BYTES = 12_000
_ALONE, _LOOK = ' xmlns="http://www.w3.org/2000/svg"', ' fill="none" stroke="currentColor"'
"""What a picture of its own needs, and one in a page has from there."""
_NUMBERS = r"[MLhl\d -]{0,9000}"
_OURS = re.compile(
    rf'<svg{_ALONE}{_LOOK} viewBox="0 0 \d{{1,3}} \d{{1,3}}">'
    rf'(<path class="(?:wall|goal|cone|passed|failed|error|end)"(?: stroke="#[0-9a-f]{{6}}")? d="{_NUMBERS}"/>){{0,40}}'
    r"</svg>\n"
)


def write(drive: DrivenPath, outcome: Outcome, target: Path) -> None:
    """Draws a drive into a file; raises OSError."""
    atomic.write_text(target, draw(drive, outcome))


def read(path: Path) -> Markup:
    """The picture in a file, empty if there is none or if it holds anything else."""
    try:
        text = regular_file.text(path, _MOST_BYTES)
    except (OSError, ValueError):
        return Markup()
    return Markup(text.replace(_ALONE + _LOOK, "", 1).rstrip("\n")) if _OURS.fullmatch(text) else Markup()  # noqa: S704  (checked)


def draw(drive: DrivenPath, outcome: Outcome) -> str:
    """The picture of a drive, its path in the colour of the outcome; of a map without lines, its cones."""
    points = [(x, y) for x, y, _, _ in drive.path]
    edges = [(x, y) for _, lines in drive.ground.lines for a, b, c, d in lines for x, y in ((a, b), (c, d))]
    xs, ys = zip(*points, *edges, strict=True)
    is_tall = max(ys) - min(ys) > _TALL * (max(xs) - min(xs))
    if is_tall:
        xs, ys = zip(*map(_turned, zip(xs, ys, strict=True)), strict=True)
    left, top, wide, high = min(xs), max(ys), max(xs) - min(xs), max(ys) - min(ys)
    scale = min((_WIDTH - 2 * _PAD) / max(wide, 0.5), (_HEIGHT - 2 * _PAD) / max(high, 0.5))

    def place(point: Point) -> tuple[int, int]:
        x, y = _turned(point) if is_tall else point
        return round(_PAD + (x - left) * scale), round(_PAD + (top - y) * scale)

    size = round(wide * scale) + 2 * _PAD, round(high * scale) + 2 * _PAD
    parts = list(_lines(drive, place)) or list(_cones(drive, place, size))
    path = list(_thinned([place(point) for point in points]))
    parts.append(_path(outcome.outcome, _joined(path)))
    x, y = path[-1]
    cross = f"M{x - 5} {y - 5}L{x + 5} {y + 5}M{x - 5} {y + 5}L{x + 5} {y - 5}"
    parts.append(_path("end", f"M{x} {y}h0" if outcome.outcome == "passed" else cross))
    return f'<svg{_ALONE}{_LOOK} viewBox="0 0 {size[0]} {size[1]}">{"".join(parts)}</svg>\n'


def _turned(point: Point) -> Point:
    """A quarter to the right, for what is tall: pictures are wide."""
    return point[1], -point[0]


def _lines(drive: DrivenPath, place: Place) -> Iterator[str]:
    for kind in ("wall", "goal"):
        found = [lines for name, lines in drive.ground.lines if (name == drive.goal) == (kind == "goal")]
        ends = [(place((a, b)), place((c, d))) for lines in found for a, b, c, d in lines]
        if ends:
            yield _path(kind, "".join(_chained(ends[:_MOST_LINES])))


def _chained(ends: Sequence[tuple[tuple[int, int], tuple[int, int]]]) -> Iterator[str]:
    """Lines that go on where the one before ended are one, and short ones are left out."""
    last = None
    for begin, end in ends:
        if begin != last:
            yield f"M{begin[0]} {begin[1]}l"
        if begin != end:
            yield f"{end[0] - begin[0]} {end[1] - begin[1]} "
        last = end


def _cones(drive: DrivenPath, place: Place, size: tuple[int, int]) -> Iterator[str]:
    for (red, green, blue), points in drive.ground.models[:20]:
        colour = "#" + "".join(f"{min(max(round(255 * part), 0), 255):02x}" for part in (red, green, blue))
        places = [place(point) for point in points[:_MOST_CONES]]
        dots = "".join(f"M{x} {y}h0" for x, y in places if 0 <= x <= size[0] and 0 <= y <= size[1])
        if dots:
            yield f'<path class="cone" stroke="{colour}" d="{dots}"/>'


def _path(kind: str, numbers: str) -> str:
    return f'<path class="{kind}" d="{numbers}"/>'


def _joined(points: Sequence[tuple[int, int]]) -> str:
    steps = (f"{x - a} {y - b}" for (a, b), (x, y) in pairwise(points))
    return f"M{points[0][0]} {points[0][1]}l{' '.join(steps)}"


def _thinned(points: Sequence[tuple[int, int]]) -> Iterable[tuple[int, int]]:
    """Points some units apart, a number of them at most, the last one included."""
    kept = [points[0]]
    for point in points[1:]:
        if math.dist(kept[-1], point) >= _CLOSE:
            kept.append(point)
    every = -(-len(kept) // _MOST_POINTS)
    return [*kept[::every], points[-1]]
