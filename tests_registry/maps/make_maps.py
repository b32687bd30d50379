"""Makes the maps beside this file: PYTHONPATH=. python tests_registry/maps/make_maps.py [FOLDER].

Tracks are made as `dodo new --map` makes them.

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

import math
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from dodo_dsl.cli.new_map import LEAD, Section, Track, as_json, bend, cones, floor, track_map

Pixels = npt.NDArray[np.integer]

SIDES = 16
PROFILE = [(0.012, 0.0), (0.012, 0.002), (0.009, 0.002), (0.0015, 0.034)]
"""Radius and height in m of the rings of corners that make a cone on its small base."""


def oval() -> list[Section]:
    """A lap that a camera on a table of 1.9 m by 1.4 m drives with 10 cm to its edges."""
    straight, turn = Section(0.45), bend(180, 0.6)
    return [straight, turn, straight, turn]


def kiwi_track() -> list[Section]:
    """A lap with four left corners and, on its way back, an S that leads inwards and out again."""
    corner, short, wave = bend(90, 1.0), Section(0.5), 25.0
    inwards = [Section(0.3), bend(wave, 1.5), bend(-2 * wave, 1.5), bend(wave, 1.5), Section(0.3)]
    straight = Section(2 * 0.3 + 4 * 1.5 * math.sin(math.radians(wave)))
    return [straight, corner, short, corner, *inwards, corner, short, corner]


UP = math.pi / 2
TRACKS = {
    "straight": Track([Section(3.0)]),
    "left-curve": Track([Section(1.0), bend(90, 1.5), Section(2.0)]),
    "kiwi-track": Track(kiwi_track(), (0.0, -LEAD, UP), lap=True),
    "rig-oval": Track(oval(), (-0.2, -0.6, 0.0), lap=True, far=True),
    "rig-straight": Track([Section(1.3)], (-0.75, 0.0, 0.0)),
}
CAR = [
    [(-0.08, -0.18, 0.0), (0.08, -0.18, 0.0), (0.08, 0.18, 0.0), (-0.08, 0.18, 0.0)],
    [(-0.06, -0.06, 0.11), (0.06, -0.06, 0.11), (0.06, 0.16, 0.11), (-0.06, 0.16, 0.11)],
]
"""The lower and the upper corners of a car in m; its front is at -y, as that of all models at frames."""
BOARD = {
    "yellow": [(0.30, 0.172), (0.36, 0.07), (0.52, 0.13), (0.56, -0.05)],
    "blue": [(0.30, -0.08), (0.42, 0.072), (0.44, -0.18), (0.58, 0.04)],
}
"""Where the cones of the static rig stand: one at the edge of the frame, one partly behind another."""


def car(frames: list[int]) -> dict[str, Any]:
    return {"name": "kiwi", "file": "kiwi.obj", "color": [0.75, 0.1, 0.6], "frames": frames}


def two_cars_map() -> dict[str, Any]:
    found = track_map(TRACKS["straight"])
    return {**found, "model": [*found["model"], car([0, 1])]}


def board_map() -> dict[str, Any]:
    """The static rig: a board of 70 x 60 cm on the floor."""
    board = {
        "name": "board",
        "dimension": [0.7, 0.6, 0.012],
        "color": [0.78, 0.66, 0.52],
        "instances": [[0.3, 0.0, -0.006, 0.0]],
    }
    return {"model": cones(BOARD["yellow"], BOARD["blue"]), "block": [floor(-0.012), board], "obstacles": []}


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
