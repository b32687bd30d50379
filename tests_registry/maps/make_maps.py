"""Makes the maps beside this file: python tests_registry/maps/make_maps.py [FOLDER].

A track starts at x = 0, y = 0 and runs along +y. Yellow cones stand on its left, blue ones on its
right, and two large red ones beside the finish; the rows begin behind the start and go on past the
finish, so that a car sees cones all the way. Obstacles: ``left`` and ``right`` are walls through the
cones, ``finish`` is the line across the lane.
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
Pixels = npt.NDArray[np.integer]

LANE = 0.5
SPACING = 0.25
BEHIND, BEYOND = 0.3, 1.0
BESIDE = 0.08
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


TRACKS = {
    "straight": [Section(3.0)],
    "left-curve": [Section(1.0), Section(1.5 * math.pi / 2, math.pi / 2), Section(0.5)],
}


def poses(sections: list[Section], offset: float) -> Iterator[tuple[float, float, float]]:
    """x, y and heading about every 25 cm along the row ``offset`` m left of the centre line."""
    x, y, heading = 0.0, -BEHIND, math.pi / 2
    for number, section in enumerate(sections):
        steps = max(1, round(section.along(offset) / SPACING))
        for step in range(min(number, 1), steps + 1):
            forward, left, turned = section.end(step / steps)
            c, s, at = math.cos(heading), math.sin(heading), heading + turned
            centre = x + c * forward - s * left, y + s * forward + c * left
            yield centre[0] - offset * math.sin(at), centre[1] + offset * math.cos(at), at
        x, y, heading = centre[0], centre[1], at


def row(sections: list[Section], offset: float) -> list[Point]:
    """Where cones stand, to a tenth of a millimetre."""
    return [(round(x, 4) + 0.0, round(y, 4) + 0.0) for x, y, _ in poses(sections, offset)]


def model(name: str, file: str, color: list[float], places: list[Point]) -> dict[str, object]:
    return {"name": name, "file": file, "color": color, "instances": [[x, y, 0.0, 0.0] for x, y in places]}


def wall(name: str, places: list[Point]) -> dict[str, object]:
    return {"name": name, "lines": [[*start, *end] for start, end in pairwise(places)]}


def track_map(track: list[Section]) -> dict[str, object]:
    driven = [Section(BEHIND), *track]
    rows = {side: row([*driven, Section(BEYOND)], side * LANE / 2) for side in (1, -1)}
    finish = [row(driven, side * LANE / 2)[-1] for side in (1, -1)]
    beside = [row(driven, side * (LANE / 2 + BESIDE))[-1] for side in (1, -1)]
    floor = {
        "name": "floor",
        "dimension": [10.0, 10.0, 0.2],
        "textureFile": "floor.png",
        "textureSize": [0.5, 0.5],
        "instances": [[0.0, 0.0, -0.1, 0.0]],
    }
    return {
        "model": [
            model("cone_yellow", "cone.obj", [1.0, 0.85, 0.0], rows[1]),
            model("cone_blue", "cone.obj", [0.0, 0.15, 0.9], rows[-1]),
            model("cone_red", "finish-cone.obj", [0.9, 0.05, 0.05], beside),
        ],
        "block": [floor],
        "obstacles": [wall("left", rows[1]), wall("right", rows[-1]), wall("finish", finish)],
    }


def as_json(value: object, indent: int = 0) -> str:
    """JSON with a line for each member and each row, and a row's numbers on one line."""
    inner = " " * (indent + 2)
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {as_json(item, indent + 2)}" for key, item in value.items()]
        return "{\n" + ",\n".join(parts) + "\n" + " " * indent + "}"
    if isinstance(value, list) and isinstance(value[0], list | dict):
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
    for name, track in TRACKS.items():
        target = folder / name
        target.mkdir(parents=True, exist_ok=True)
        (target / "map.json").write_text(as_json(track_map(track)) + "\n")
        (target / "cone.obj").write_text(cone_obj(1.0))
        (target / "finish-cone.obj").write_text(cone_obj(2.0))
        packed = cv2.imencode(".png", floor_picture(), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1]
        (target / "floor.png").write_bytes(packed.tobytes())


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
