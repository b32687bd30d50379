"""The map of a test from above, and the picture of a drive on it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dodo_dsl import atomic
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.plan.model import Plan

MAP = "map-path"
"""The parameter of all services that read the test's map."""
_GREY = 0.5, 0.5, 0.5

Point = tuple[float, float]
Line = tuple[float, float, float, float]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Ground:
    """The map from above: model positions in metres by colour (RGB, 0 to 1), named lines, and what moves on it."""

    models: list[tuple[tuple[float, float, float], list[Point]]] = field(default_factory=list)
    lines: list[tuple[str, list[Line]]] = field(default_factory=list)
    moving: tuple[map_file.ModelEntry, ...] = ()
    """Models at the frames of vehicles."""


@dataclass(frozen=True)
class Way:
    """The sender stamp of the vehicle's frames, its size in m, and the roles of the map's obstacles by their names."""

    frame: int = 0
    length: float = 0.0
    width: float = 0.0
    roles: Mapping[str, str] = field(default_factory=dict)


def ground_of(plan: Plan, folder: Path) -> Ground:
    """The map of a test, of which its judges come last; ``folder`` is the compiled test's."""
    maps = [flag.value for service in plan.services for flag in service.flags if flag.name == MAP]
    return read_ground(folder / FILES / maps[-1]) if maps else Ground()


def read_ground(place: Path) -> Ground:
    """The parts of an OpenDLV map that a picture shows; an unreadable map is empty: services report its errors."""
    found, _ = map_file.problems(place)
    if found is None:
        return Ground()
    models = [
        (colour_of(model), [each.position[:2] for each in model.instances]) for model in found.models if model.instances
    ]
    try:
        lines = [(name, [(*a, *b) for a, b in each]) for name, each in map_file.read_obstacles(found.path).items()]
        lines += [(name, _edges(each)) for name, each in map_file.footprints(found.blocks).items() if each]
    except InputError:
        lines = []
    moving = tuple(model for model in found.models if model.frames)
    return Ground(models, lines, moving)


def _edges(outlines: Iterable[map_file.Outline]) -> list[Line]:
    return [(*a, *b) for corners in outlines for a, b in pairwise([*corners, corners[0]])]


def colour_of(model: map_file.ModelEntry) -> tuple[float, float, float]:
    """Red, green and blue from 0 to 1; grey for a texture, or materials."""
    return model.paint if isinstance(model.paint, tuple) else _GREY


_WIDTH, _HEIGHT, _PAD = 480, 360, 16
"""Pixels of the picture at most, and around what it shows."""
_TALL = 1.5
_SHIFT = 4
_COLOURS = {
    "passed": (46, 160, 67), "failed": (229, 83, 75), "error": (191, 135, 0),
    "wall": (140, 149, 159), "other": (140, 149, 159), "gate": (130, 80, 223), "goal": (47, 129, 247),
}  # fmt: skip
"""Of the path by its outcome and of lines by their roles: those that stand out on white and on black."""


def draw(target: Path, ground: Ground, way: Way, path: Points, outcome: str) -> None:
    """The path of ``x`` and ``y`` in m on the map, as a PNG that is transparent elsewhere; raises OSError."""
    import cv2  # which takes longer to load than the rest of a page

    ends = np.array([line for _, lines in ground.lines for line in lines], np.float64).reshape(-1, 2)
    around = np.concatenate([path, ends])
    (wide, high), turn = np.ptp(around, axis=0), np.eye(2)
    if high > _TALL * wide:
        turn = np.array([[0, -1], [1, 0]])  # pictures are wide
    around = around @ turn
    low, size = around.min(axis=0), np.maximum(np.ptp(around, axis=0), 0.5)
    scale = ((_WIDTH - 2 * _PAD, _HEIGHT - 2 * _PAD) / size).min()
    width, height = np.rint(size * scale).astype(int) + 2 * _PAD
    pixels = np.full((height, width, 4), (128, 128, 128, 0), np.uint8)

    def placed(points: object) -> NDArray[np.int32]:
        from_low = (np.asarray(points, np.float64).reshape(-1, 2) @ turn - low) * scale + _PAD
        from_low[:, 1] = height - from_low[:, 1]
        pixel: NDArray[np.int32] = np.rint(np.clip(from_low, -10_000, 10_000) * (1 << _SHIFT)).astype(np.int32)
        return pixel

    def dot(place: NDArray[np.int32], radius: int, colour: tuple[int, ...]) -> None:
        x, y = place.tolist()
        cv2.circle(pixels, (x, y), radius << _SHIFT, _bgra(colour), cv2.FILLED, cv2.LINE_AA, _SHIFT)

    for colour, points in ground.models:
        for place in placed(points):
            dot(place, 3, tuple(round(255 * part) for part in colour))
    for name, lines in ground.lines:
        role = way.roles.get(name, "other")
        parts = list(placed(lines).reshape(-1, 2, 2))
        cv2.polylines(pixels, parts, False, _bgra(_COLOURS[role]), 3 if role == "goal" else 2, cv2.LINE_AA, _SHIFT)
    driven = placed(path)
    cv2.polylines(pixels, [driven], False, _bgra(_COLOURS[outcome]), 3, cv2.LINE_AA, _SHIFT)
    dot(driven[-1], 6, _COLOURS[outcome])
    atomic.write_bytes(target, cv2.imencode(".png", pixels)[1].tobytes())


def _bgra(colour: tuple[int, ...]) -> tuple[int, ...]:
    return (*reversed(colour), 255)
