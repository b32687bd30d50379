"""Makes the maps beside this file: python tests_registry/maps/make_maps.py [FOLDER].

Yellow cones stand on the left of a track, blue ones on its right, and two large red ones next to the
finish. Obstacles: ``left`` and ``right`` are walls through the cones, ``finish`` is the line across the
lane. An open track starts at x = 0, y = 0 along +y, or elsewhere where it names another start; its rows begin behind
the start and go on past the finish, so that a car sees cones all the way, and ``behind`` and ``beyond`` close its ends.
A lap begins at the finish; the car starts LEAD m past it, and ``behind``, between the two, is what a car hits that
backs up to the finish.
An oval has ``far`` instead, the line half-way round.
``two-cars`` is the straight track with another car, at the frames of sender stamp 1; the car of the test
has stamp 0. ``static-rig`` is not a track but a board with eight cones, seen from x = 0, y = 0 along +x.
"""

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

Point = tuple[float, float]
Place = tuple[float, float, float]
Pixels = npt.NDArray[np.integer]

LANE = 0.5
SPACING = 0.25
BEHIND, BEYOND = 0.3, 1.0
BESIDE = 0.08
LEAD, BACK = 0.8, 0.3
SIDES = 16
PROFILE = [(0.012, 0.0), (0.012, 0.002), (0.009, 0.002), (0.0015, 0.034)]
"""Radius and height in m of the rings of corners that make a cone on its small base."""


@dataclass(frozen=True)
class Section:
    """A part of the centre line: ``length`` m, bending left by ``bend`` rad in all."""

    length: float
    bend: float = 0.0

    def along(self, offset: float) -> float:
        """The length in m of the row ``offset`` m left of the centre line."""
        return self.length - offset * self.bend

    def end(self, part: float = 1.0) -> tuple[float, float, float]:
        """Forward, left and heading after a part of the section, from its beginning."""
        turned = self.bend * part
        if not self.bend:
            return self.length * part, 0.0, 0.0
        radius = self.length / self.bend
        return radius * math.sin(turned), radius * (1 - math.cos(turned)), turned


@dataclass(frozen=True)
class Track:
    """A centre line; it starts at ``x``, ``y`` with ``heading`` (m, rad). A ``lap`` ends where it begins.

    With ``far``, a lap has this line half-way round, for gates, instead of the wall behind the start.
    """

    sections: list[Section]
    x: float = 0.0
    y: float = 0.0
    heading: float = math.pi / 2
    lap: bool = False
    far: bool = False

    @property
    def start(self) -> Place:
        return self.x, self.y, self.heading


def left(degrees: float, radius: float) -> Section:
    """A bend; negative degrees turn right."""
    return Section(radius * math.radians(abs(degrees)), math.radians(degrees))


def oval() -> list[Section]:
    """A lap that a camera on a table of 1.9 m by 1.4 m drives with 10 cm to its edges."""
    straight, bend = Section(0.45), left(180, 0.6)
    return [straight, bend, straight, bend]


def kiwi_track() -> list[Section]:
    """A lap with four left corners and, on its way back, an S that leads inwards and out again."""
    corner, short, wave = left(90, 1.0), Section(0.5), 25.0
    inwards = [Section(0.3), left(wave, 1.5), left(-2 * wave, 1.5), left(wave, 1.5), Section(0.3)]
    straight = Section(2 * 0.3 + 4 * 1.5 * math.sin(math.radians(wave)))
    return [straight, corner, short, corner, *inwards, corner, short, corner]


TRACKS = {
    "straight": Track([Section(3.0)]),
    "left-curve": Track([Section(1.0), Section(1.5 * math.pi / 2, math.pi / 2), Section(2.0)]),
    "kiwi-track": Track(kiwi_track(), y=-LEAD, lap=True),
    "rig-oval": Track(oval(), x=-0.2, y=-0.6, heading=0.0, lap=True, far=True),
    "rig-straight": Track([Section(1.3)], x=-0.75, heading=0.0),
}
CAR = [
    [(-0.08, -0.18, 0.0), (0.08, -0.18, 0.0), (0.08, 0.18, 0.0), (-0.08, 0.18, 0.0)],
    [(-0.06, -0.06, 0.11), (0.06, -0.06, 0.11), (0.06, 0.16, 0.11), (-0.06, 0.16, 0.11)],
]
"""The lower and the upper corners of a car in m; its front is at -y, as that of all models at frames."""
YELLOW, BLUE = [0.8, 0.69, 0.13], [0.11, 0.16, 0.32]
"""Colours of cones, as those of real ones in pictures of a Kiwi car; docs/reference/maps.md has what was measured."""
BOARD = {
    "yellow": [(0.30, 0.172), (0.36, 0.07), (0.52, 0.13), (0.56, -0.05)],
    "blue": [(0.30, -0.08), (0.42, 0.072), (0.44, -0.18), (0.58, 0.04)],
}
"""Where the cones of the static rig stand: one at the edge of the frame, one partly behind another."""


def poses(sections: list[Section], offset: float, start: Place) -> Iterator[Place]:
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


def ahead(place: Place, distance: float) -> Place:
    x, y, heading = place
    return x + distance * math.cos(heading), y + distance * math.sin(heading), heading


def row(sections: list[Section], offset: float, start: Place) -> list[Point]:
    """Where cones stand, to a tenth of a millimetre."""
    return [(round(x, 4) + 0.0, round(y, 4) + 0.0) for x, y, _ in poses(sections, offset, start)]


def across(place: Place, reach: float) -> list[Point]:
    """The two points ``reach`` m to the left and to the right of a position."""
    return [row([Section(1.0)], side * reach, place)[0] for side in (1, -1)]


def model(name: str, file: str, color: list[float], places: list[Point]) -> dict[str, object]:
    return {"name": name, "file": file, "color": color, "instances": [[x, y, 0.0, 0.0] for x, y in places]}


def car(frames: list[int]) -> dict[str, object]:
    return {"name": "kiwi", "file": "kiwi.obj", "color": [0.75, 0.1, 0.6], "frames": frames}


def wall(name: str, places: list[Point]) -> dict[str, object]:
    return {"name": name, "lines": [[*start, *end] for start, end in pairwise(places)]}


def cones(yellow: list[Point], blue: list[Point]) -> list[dict[str, object]]:
    return [
        model("cone_yellow", "cone.obj", YELLOW, yellow),
        model("cone_blue", "cone.obj", BLUE, blue),
    ]


def floor(height: float = 0.0) -> dict[str, object]:
    return {
        "name": "floor",
        "dimension": [10.0, 10.0, 0.2],
        "textureFile": "floor.png",
        "textureSize": [0.5, 0.5],
        "instances": [[0.0, 0.0, height - 0.1, 0.0]],
    }


def track_map(track: Track) -> dict[str, object]:
    begin = track.start if track.lap else ahead(track.start, -BEHIND)
    driven = track.sections if track.lap else [Section(BEHIND), *track.sections]
    beyond = [] if track.lap else [Section(BEYOND)]
    rows = {side: row([*driven, *beyond], side * LANE / 2, begin) for side in (1, -1)}
    *_, finish = poses(driven, 0.0, begin)
    lines = [wall("left", rows[1]), wall("right", rows[-1]), wall("finish", across(finish, LANE / 2))]
    if not track.lap:
        *_, end = poses([*driven, *beyond], 0.0, begin)
        behind = [rows[1][0], *across(ahead(begin, -BEHIND), LANE / 2), rows[-1][0]]
        lines += [wall("behind", behind), wall("beyond", across(end, LANE / 2))]
    elif track.far:
        *_, half = poses(track.sections[: len(track.sections) // 2], 0.0, begin)
        lines.append(wall("far", across(ahead(half, track.sections[0].length / 2), LANE / 2)))
    else:
        lines.append(wall("behind", across(ahead(track.start, LEAD - BACK), LANE / 2)))
        rows = {side: places[:-1] for side, places in rows.items()}
    red = model("cone_red", "finish-cone.obj", [0.9, 0.05, 0.05], across(finish, LANE / 2 + BESIDE))
    return {"model": [*cones(rows[1], rows[-1]), red], "block": [floor()], "obstacles": lines}


def two_cars_map() -> dict[str, object]:
    found = track_map(TRACKS["straight"])
    models = found["model"]
    assert isinstance(models, list)
    return {**found, "model": [*models, car([0, 1])]}


def board_map() -> dict[str, object]:
    """The static rig: a board of 70 x 60 cm on the floor."""
    board = {
        "name": "board",
        "dimension": [0.7, 0.6, 0.012],
        "color": [0.78, 0.66, 0.52],
        "instances": [[0.3, 0.0, -0.006, 0.0]],
    }
    return {"model": cones(BOARD["yellow"], BOARD["blue"]), "block": [floor(-0.012), board], "obstacles": []}


def as_json(value: object, indent: int = 0) -> str:
    """JSON with a line for each member and each row, and a row's numbers on one line."""
    inner = " " * (indent + 2)
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {as_json(item, indent + 2)}" for key, item in value.items()]
        return "{\n" + ",\n".join(parts) + "\n" + " " * indent + "}"
    if isinstance(value, list) and value and isinstance(value[0], list | dict):
        return "[\n" + ",\n".join(inner + as_json(item, indent + 2) for item in value) + "\n" + " " * indent + "]"
    return json.dumps(value)


def cone_obj(scale: float) -> str:
    """A cone of 16 sides in the OBJ format, z up, standing on z = 0."""
    turns = [2 * math.pi * side / SIDES for side in range(SIDES)]
    corners = [
        f"v {scale * r * math.cos(t):.6f} {scale * r * math.sin(t):.6f} {scale * z:.6f}"
        for r, z in PROFILE
        for t in turns
    ]
    faces = [range(SIDES, 0, -1), range(SIDES * (len(PROFILE) - 1) + 1, SIDES * len(PROFILE) + 1)]
    quads = []
    for ring in range(len(PROFILE) - 1):
        for side in range(SIDES):
            low, next_low = ring * SIDES + side + 1, ring * SIDES + (side + 1) % SIDES + 1
            quads.append([low, next_low, next_low + SIDES, low + SIDES])
    lines = ["f " + " ".join(map(str, face)) for face in [*quads, *faces]]
    return "\n".join(["# A traffic cone, in metres", "o cone", *corners, *lines]) + "\n"


def car_obj() -> str:
    """A car that is narrower above than below, with its flat back at +y."""
    corners = [f"v {x:.3f} {y:.3f} {z:.3f}" for ring in CAR for x, y, z in ring]
    quads = [[4, 3, 2, 1], [5, 6, 7, 8], *([n, n % 4 + 1, n % 4 + 5, n + 4] for n in range(1, 5))]
    lines = ["f " + " ".join(map(str, face)) for face in quads]
    return "\n".join(["# A car of the size of a Kiwi, in metres", "o kiwi", *corners, *lines]) + "\n"


def _around(field: Pixels, reach: int) -> Pixels:
    """The sum over a square around each pixel, on a tile that repeats."""
    for axis in (0, 1):
        field = np.sum([np.roll(field, shift, axis) for shift in range(-reach, reach + 1)], axis=0)
    return field


def floor_picture() -> Pixels:
    """A grey carpet, 256 x 256 pixels for half a metre: fine fibres, soft blotches."""
    noise = np.random.RandomState(7)
    fibres = noise.randint(-6, 7, (256, 256))
    blotches = _around(noise.randint(-64, 65, (256, 256)), 6) // 60
    return (104 + fibres + blotches).clip(0, 255).astype(np.uint8)


def make(folder: Path) -> None:
    maps = {name: track_map(track) for name, track in TRACKS.items()}
    for name, content in {**maps, "two-cars": two_cars_map(), "static-rig": board_map()}.items():
        target = folder / name
        target.mkdir(parents=True, exist_ok=True)
        (target / "map.json").write_text(as_json(content) + "\n")
        (target / "cone.obj").write_text(cone_obj(1.0))
        if name == "two-cars":
            (target / "kiwi.obj").write_text(car_obj())
        if name != "static-rig":
            (target / "finish-cone.obj").write_text(cone_obj(2.0))
        packed = cv2.imencode(".png", floor_picture(), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1]
        (target / "floor.png").write_bytes(packed.tobytes())


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
