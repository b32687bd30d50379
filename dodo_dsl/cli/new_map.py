"""``dodo new --map``: a track of cones around a centre line, as a map that services read."""

import csv
import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.spec import quantity

Point = tuple[float, float]
Pose = tuple[float, float, float]
"""x and y in m, heading in rad."""

LANE = 0.5
_MOST = 1000
SPACING = 0.25
_TURN_BACK = 1e-6
"""Radians that a corner is short of a turn on the spot."""
BEHIND, BEYOND = 0.3, 1.0
BESIDE = 0.08
LEAD, BACK = 0.8, 0.3
YELLOW, BLUE, RED = [0.8, 0.69, 0.13], [0.11, 0.16, 0.32], [0.9, 0.05, 0.05]
"""Colours of cones, as those of real ones in pictures of a Kiwi car; docs/reference/maps.md has what was measured."""
EXPECTED = "expected parts such as 'straight 2 m, left 90 deg radius 1.5 m, right 45 deg radius 1 m'"
_PART = re.compile(r"straight (?P<length>.+)|(?P<side>left|right) (?P<angle>.+) radius (?P<radius>.+)")


@dataclass(frozen=True)
class Section:
    """A part of the centre line: ``length`` m, bending left by ``bend`` rad in all."""

    length: float
    bend: float = 0.0

    def along(self, offset: float) -> float:
        """The length in m of the row ``offset`` m left of the centre line."""
        return self.length - offset * self.bend

    def end(self, part: float = 1.0) -> Pose:
        """Forward, left and heading after a part of the section, from its beginning."""
        turned = self.bend * part
        if not self.bend:
            return self.length * part, 0.0, 0.0
        radius = self.length / self.bend
        return radius * math.sin(turned), radius * (1 - math.cos(turned)), turned


def bend(degrees: float, radius: float) -> Section:
    """A bend to the left; negative degrees turn right."""
    return Section(radius * math.radians(abs(degrees)), math.radians(degrees))


@dataclass(frozen=True)
class Track:
    """A centre line from x, y and heading of ``start`` (m, rad). A ``lap`` ends where it begins.

    With ``far``, a lap has this line half-way round, for gates, instead of the wall behind the start.
    """

    sections: Sequence[Section]
    start: Pose = (0.0, 0.0, math.pi / 2)
    lap: bool = False
    far: bool = False
    width: float = LANE

    @property
    def begin(self) -> Pose:
        """Where the vehicle starts: on a lap past the finish."""
        return ahead(self.start, LEAD) if self.lap else self.start

    @property
    def length(self) -> float:
        """To the finish, in m."""
        return sum(section.length for section in self.sections) - (LEAD if self.lap else 0)


def track(line: str, width: str, lap: bool) -> Track:
    """The track along a centre line: parts from x = 0, y = 0 along +y, or a CSV file of points; raises UsageError."""
    if line.endswith(".csv"):
        if lap:
            raise UsageError("--lap is for a line of parts: points end where they end")
        made = _through(_points(Path(line)))
    else:
        sections = [_section(part.strip()) for part in line.split(",")]
        made = Track(sections, (0.0, -LEAD, math.pi / 2) if lap else Track.start, lap)
    made = replace(made, width=_quantity("--width", width, "m"))
    _check(made)
    return made


def _section(text: str) -> Section:
    match = _PART.fullmatch(text)
    if match is None:
        raise UsageError(f"--line: '{text}' is not part of a centre line, {EXPECTED}")
    if match["length"]:
        return Section(_quantity("--line", match["length"], "m"))
    degrees = _quantity("--line", match["angle"], "deg") * (1 if match["side"] == "left" else -1)
    return bend(degrees, _quantity("--line", match["radius"], "m"))


def _quantity(option: str, text: str, unit: str) -> float:
    try:
        value = float(quantity.convert(text, unit))
    except quantity.QuantityError as error:
        raise UsageError(f"{option}: {error}") from None
    if not 0 < value < _MOST:
        raise UsageError(f"{option}: '{text}' is out of range, expected more than 0 and less than {_MOST} {unit}")
    return value


def _points(path: Path) -> list[Point]:
    """The points of a CSV file, but those that are nearer than cones are to one another."""
    found: list[Point] = []
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        for number, row in enumerate(csv.reader(line.replace("\0", "?") for line in file), 1):
            try:
                x, y = map(float, row)
            except ValueError:
                if number > 1:  # names of columns
                    raise UsageError(f"{path}:{number}: expected two numbers, x and y in m") from None
                continue
            if not math.hypot(x, y) < _MOST:
                raise UsageError(f"{path}:{number}: expected x and y in m, less than {_MOST} m from the middle")
            if not found or math.dist(found[-1], (x, y)) >= SPACING:
                found.append((x, y))
    if len(found) < 2:
        raise UsageError(f"{path}: expected two or more points, x and y in m, {SPACING} m or more apart")
    return found


def _through(points: Sequence[Point]) -> Track:
    """A track along points, whose corners are rounded by arcs that end at most in the middle of an edge."""
    edges = [(math.dist(a, b), math.atan2(b[1] - a[1], b[0] - a[0])) for a, b in pairwise(points)]
    sections = [Section(edges[0][0] / 2)]
    for (before, old), (after, new) in pairwise(edges):
        turn, room = math.remainder(new - old, math.tau), min(before, after) / 2
        if abs(turn) > math.pi - _TURN_BACK:
            raise UsageError("--line: the points turn back on themselves, expected a line that can be driven")
        radius = room / math.tan(abs(turn) / 2) if turn else 0.0
        arc = Section(radius * abs(turn), turn) if turn else Section(2 * room)
        sections += [
            part for part in (Section(before / 2 - room), arc, Section(after / 2 - room)) if part.length > 1e-9
        ]
    return Track([*sections, Section(edges[-1][0] / 2)], (*points[0], edges[0][1]))


def _check(track: Track) -> None:
    """Raises UsageError for a track that cannot be: its bends are too tight for its width, or a lap does not close."""
    for section in track.sections:
        radius = abs(section.length / section.bend) if section.bend else math.inf
        if radius <= track.width / 2:
            raise UsageError(f"a bend of radius {radius:.3g} m is too tight for a track of {track.width:g} m")
    if track.lap:
        *_, (x, y, heading) = poses(track.sections, 0.0, track.start)
        gap, turn = math.dist((x, y), track.start[:2]), math.remainder(heading - track.start[2], math.tau)
        if gap > 0.01 or abs(turn) > 0.01:
            raise UsageError(
                f"the lap does not close: it ends {gap:.3f} m and {math.degrees(turn):.1f} deg from its start"
            )
        if track.sections[0].bend or track.sections[0].length < LEAD + BACK:
            raise UsageError(f"a lap begins with a straight of {LEAD + BACK:g} m or more, past the finish")


def poses(sections: Sequence[Section], offset: float, start: Pose) -> Iterator[Pose]:
    """x, y and heading about every 25 cm along the row ``offset`` m left of the centre line."""
    x, y, heading = start
    for number, section in enumerate(sections):
        steps = max(1, round(section.along(offset) / SPACING))
        for step in range(min(number, 1), steps + 1):
            forward, left, turned = section.end(step / steps)
            c, s, at = math.cos(heading), math.sin(heading), heading + turned
            centre = x + c * forward - s * left, y + s * forward + c * left
            yield centre[0] - offset * math.sin(at), centre[1] + offset * math.cos(at), at
        x, y, heading = centre[0], centre[1], at


def ahead(place: Pose, distance: float) -> Pose:
    x, y, heading = place
    return x + distance * math.cos(heading), y + distance * math.sin(heading), heading


def row(sections: Sequence[Section], offset: float, start: Pose) -> list[Point]:
    """Where cones stand, to a tenth of a millimetre."""
    return [(round(x, 4) + 0.0, round(y, 4) + 0.0) for x, y, _ in poses(sections, offset, start)]


def across(place: Pose, reach: float) -> list[Point]:
    """The two points ``reach`` m to the left and to the right of a position."""
    return [row([Section(1.0)], side * reach, place)[0] for side in (1, -1)]


def model(name: str, file: str, color: list[float], places: Sequence[Point]) -> dict[str, Any]:
    return {"name": name, "file": file, "color": color, "instances": [[x, y, 0.0, 0.0] for x, y in places]}


def cones(yellow: Sequence[Point], blue: Sequence[Point]) -> list[dict[str, Any]]:
    return [model("cone_yellow", "cone.obj", YELLOW, yellow), model("cone_blue", "cone.obj", BLUE, blue)]


def wall(name: str, places: Sequence[Point]) -> dict[str, Any]:
    return {"name": name, "lines": [[*start, *end] for start, end in pairwise(places)]}


def floor(height: float = 0.0, size: float = 10.0) -> dict[str, Any]:
    return {
        "name": "floor",
        "dimension": [size, size, 0.2],
        "textureFile": "floor.png",
        "textureSize": [0.5, 0.5],
        "instances": [[0.0, 0.0, height - 0.1, 0.0]],
    }


def track_map(track: Track) -> dict[str, Any]:
    """Yellow cones on the left, blue ones on the right, large red ones beside the finish, and lines for collision."""
    half, outer = track.width / 2, track.width / 2 + BESIDE
    begin = track.start if track.lap else ahead(track.start, -BEHIND)
    driven = track.sections if track.lap else [Section(BEHIND), *track.sections]
    beyond = [] if track.lap else [Section(BEYOND)]
    rows = {side: row([*driven, *beyond], side * half, begin) for side in (1, -1)}
    *_, finish = poses(driven, 0.0, begin)
    lines = [wall("left", rows[1]), wall("right", rows[-1]), wall("finish", across(finish, half))]
    if not track.lap:
        *_, end = poses([*driven, *beyond], 0.0, begin)
        behind = [rows[1][0], *across(ahead(begin, -BEHIND), half), rows[-1][0]]
        lines += [wall("behind", behind), wall("beyond", across(end, half))]
    elif track.far:
        *_, middle = poses(track.sections[: len(track.sections) // 2], 0.0, begin)
        lines.append(wall("far", across(ahead(middle, track.sections[0].length / 2), half)))
    else:
        lines.append(wall("behind", across(ahead(track.start, LEAD - BACK), half)))
        rows = {side: places[:-1] for side, places in rows.items()}
    red = model("cone_red", "finish-cone.obj", RED, across(finish, outer))
    reach = max(abs(value) for places in rows.values() for place in places for value in place)
    ground = floor(size=max(10.0, math.ceil(2 * reach)))
    return {"model": [*cones(rows[1], rows[-1]), red], "block": [ground], "obstacles": lines}


def as_json(value: object, indent: int = 0) -> str:
    """JSON with a line for each member and each row, and a row's numbers on one line."""
    inner = " " * (indent + 2)
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {as_json(item, indent + 2)}" for key, item in value.items()]
        return "{\n" + ",\n".join(parts) + "\n" + " " * indent + "}"
    if isinstance(value, list) and value and isinstance(value[0], list | dict):
        return "[\n" + ",\n".join(inner + as_json(item, indent + 2) for item in value) + "\n" + " " * indent + "]"
    return json.dumps(value)
