"""An OpenDLV ``map.json``, checked, and its obstacles as an evaluator needs them: named lines on the ground.

Models and textures are not loaded yet.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import msgspec
from msgspec import Meta, Struct

from dodo_dsl.opendlv.assets import mesh_text
from dodo_dsl.opendlv.assets.json_file import (
    MAX_NUMBER,
    Number,
    Text,
    converted,
    load,
    near,
    read_bytes,
    unread,
)
from dodo_dsl.opendlv.assets.problem import InputError

MAX_INSTANCES, MAX_BLOCKS = 100_000, 500
MAX_FRAMES = 100
MAX_OVERLAYS = 50
"""Places of overlays, each of which takes the memory of an image."""
MAX_LINES = 10_000
"""Of all obstacles of a map, to each of which evaluators measure the distance."""
FRAME_TURN = math.pi / 2
"""A model at a frame is turned by the frame's yaw and this, in rad about z: it looks along its own -y."""
NO_BODIES = "no model of the map has 'frames' of other sender stamps than the vehicle's"
LOWEST, HIGHEST = 0.01, 0.15
"""m above the ground: a block that is lower is driven over; the Kiwi car is as high."""

Positive = Annotated[float, Meta(gt=0, le=MAX_NUMBER)]
Part = Annotated[float, Meta(ge=0, le=1)]
Share = Annotated[float, Meta(gt=0, le=1)]
Stamps = Annotated[tuple[Annotated[int, Meta(ge=0, lt=2**32)], ...], Meta(max_length=MAX_FRAMES)]
Paint = tuple[Part, Part, Part] | Path
"""A colour as r, g, b from 0 to 1, or the file of a texture."""
Line = tuple[tuple[float, float], tuple[float, float]]
Outline = tuple[tuple[float, float], ...]
Report = Callable[[InputError], None]


class Instance(NamedTuple):
    """Where a thing stands: its position in m, its OpenDLV angle in rad (0 is half a turn, then clockwise)."""

    x: Number
    y: Number
    z: Number
    angle: Number

    @property
    def position(self) -> tuple[float, float, float]:
        return self.x, self.y, self.z


class _Painted(Struct, frozen=True, rename="camel", kw_only=True):
    name: Text
    color: tuple[Part, Part, Part] | None = None
    texture_file: Path | None = None
    instances: tuple[Instance, ...] = ()

    @property
    def paint(self) -> Paint | None:
        return self.texture_file or self.color


class ModelEntry(_Painted, frozen=True, rename="camel", kw_only=True):
    """An OBJ file, its paint, and where copies of it stand; one more is at the frame of each sender stamp.

    Without paint it has the materials of its file.
    """

    file: Path
    frames: Stamps = ()

    def __post_init__(self) -> None:
        if not self.paint and b"usemtl" not in read_bytes(self.file):
            raise ValueError("'color' or 'textureFile' is missing")
        if len(set(self.frames)) < len(self.frames):
            raise ValueError("a sender stamp appears twice among its frames")

    def footprint(self) -> list[tuple[float, float]]:
        """The model's convex outline from above, at a frame at the origin that looks along x; raises InputError."""
        cos, sin = math.cos(FRAME_TURN), math.sin(FRAME_TURN)
        return [(cos * x - sin * y, sin * x + cos * y) for x, y in mesh_text.outline(self.file)]


class BlockEntry(_Painted, frozen=True, rename="camel", kw_only=True):
    """A box, ``dimension`` in m and centred on each instance; ``texture_size`` is that of its texture in m."""

    dimension: tuple[Positive, Positive, Positive]
    texture_size: tuple[Positive, Positive] | None = None

    def __post_init__(self) -> None:
        if not self.paint:
            raise ValueError("'color' or 'textureFile' is missing")


class OverlayEntry(Struct, frozen=True, rename="camel"):
    """An image laid over the camera's: its size and positions (upper left corners) as fractions of that image.

    OpenDLV reads the first two numbers of a position; maps often have four, as elsewhere.
    """

    name: Text
    dimension: tuple[Share, Share]
    texture_file: Path
    instances: tuple[Annotated[tuple[Number, ...], Meta(min_length=2, max_length=4)], ...] = ()


class Obstacle(Struct, frozen=True):
    """Lines on the ground, from x1, y1 to x2, y2 in m."""

    lines: Annotated[list[tuple[Number, Number, Number, Number]], Meta(min_length=1)]
    name: Text | None = None


class MapFile(NamedTuple):
    """Everything to draw; things without instances are left out."""

    path: Path
    models: tuple[ModelEntry, ...]
    blocks: tuple[BlockEntry, ...]
    overlays: tuple[OverlayEntry, ...] = ()


LISTS: dict[str, type[Struct]] = {
    "model": ModelEntry,
    "block": BlockEntry,
    "overlay": OverlayEntry,
    "obstacles": Obstacle,
}
Kind = TypeVar("Kind", bound=Struct)
WALLS = ".txt"
"""The suffix of a map of older simulations, which has walls alone."""


def find_map(path: Path) -> Path:
    """The ``map.json`` of a map given as its folder or as the file itself."""
    return path / "map.json" if path.is_dir() else path


def document_of(file: Path) -> Any:
    if file.suffix != WALLS:
        return load(file)
    lines = enumerate(read_bytes(file).decode(errors="replace").splitlines(), 1)
    walls = [_wall(file, wall, number) for number, line in lines for wall in line.split(";") if wall.strip()]
    if not walls:
        raise InputError(file, "the file is empty, expected a wall x1,y1,x2,y2; in m", line=1)
    return {"obstacles": [{"lines": [wall]} for wall in walls]}


def _wall(file: Path, text: str, line: int) -> list[float]:
    try:
        wall = [float(word) for word in text.split(",")]
    except ValueError:
        wall = []
    if len(wall) != 4 or not all(abs(value) <= MAX_NUMBER for value in wall):
        raise InputError(file, f"expected a wall x1,y1,x2,y2; in m, found '{text.strip():.60}'", line=line)
    return wall


def read_map(path: Path) -> MapFile:
    """Reads and checks the map in a folder (or a ``map.json``); InputError names the file and the JSON path."""
    file = find_map(path)
    return _collected(file, document_of(file), _raised)


def problems(path: Path) -> tuple[MapFile | None, list[InputError]]:
    """What can be drawn of a map, None for what is not a map, and all that is wrong with it."""
    file, found = find_map(path), list[InputError]()
    try:
        document = converted(file, document_of(file), dict)
    except InputError as error:
        return None, [error]
    read = _collected(file, document, found.append)
    return read, [*found, *unread(file, document, LISTS)]


def _collected(file: Path, document: object, report: Report) -> MapFile:
    models = _last_of_each_frame(_entries(file, document, "model", ModelEntry, report))
    blocks = _entries(file, document, "block", BlockEntry, report)
    overlays = _entries(file, document, "overlay", OverlayEntry, report)
    for key, what, count, limit in (
        ("model", "instances", sum(len(m.instances) for m in models), MAX_INSTANCES),
        ("model", "frames", sum(len(m.frames) for m in models), MAX_FRAMES),
        ("block", "instances", sum(len(b.instances) for b in blocks), MAX_BLOCKS),
        ("overlay", "instances", sum(len(o.instances) for o in overlays), MAX_OVERLAYS),
    ):
        if count > limit:
            report(InputError(file, f"{count} {what} of {key}s, expected at most {limit}", f"$.{key}"))
    return MapFile(file, models, blocks, overlays)


def _last_of_each_frame(models: tuple[ModelEntry, ...]) -> tuple[ModelEntry, ...]:
    last = {frame: index for index, model in enumerate(models) for frame in model.frames}
    kept = (
        msgspec.structs.replace(model, frames=tuple(frame for frame in model.frames if last[frame] == index))
        for index, model in enumerate(models)
    )
    return tuple(model for model in kept if model.instances or model.frames)


def _entries(file: Path, document: object, key: str, kind: type[Kind], report: Report) -> tuple[Kind, ...]:
    """The entries of a list in a map that stand somewhere; ``report`` gets what is wrong with others."""
    found, hook = list[Kind](), partial(_resource, file.parent.resolve())
    try:
        listed = converted(file, converted(file, document, dict).get(key, []), list, f"$.{key}")
    except InputError as error:
        report(error)
        return ()
    for index, entry in enumerate(listed):
        try:
            if kind is Obstacle or _stands(entry):
                found.append(converted(file, entry, kind, f"$.{key}[{index}]", hook))
        except InputError as error:
            report(error)
    return tuple(found)


def _stands(entry: object) -> bool:
    return not isinstance(entry, dict) or any(entry.get(key, []) != [] for key in ("instances", "frames"))


def _raised(error: InputError) -> None:
    raise error


def _resource(folder: Path, _kind: type, name: object) -> Path:
    try:
        path = (folder / str(name)).resolve()
        is_file = path.is_file()
    except (ValueError, OSError, RuntimeError):
        raise ValueError("expected the path of a file") from None
    if not path.is_relative_to(folder):
        hint = "copy it there: the map's folder goes with the test"
        raise ValueError("expected a file inside the map's folder, and no symbolic link out of it", hint)
    if not is_file or not isinstance(name, str):
        beside = [each.name for each in path.parent.iterdir() if each.is_file()] if path.parent.is_dir() else []
        raise ValueError("expected a regular file in the map's folder", near(path.name, beside))
    return path


def bodies(models: Sequence[ModelEntry], own: int) -> dict[int, tuple[str, ModelEntry]]:
    """Name and model at each frame but the vehicle's ``own``; the frame distinguishes those of one name."""
    found = {stamp: model for model in models for stamp in model.frames if stamp != own}
    names = [model.name for model in found.values()]
    return {
        stamp: (model.name if names.count(model.name) == 1 else f"{model.name}/{stamp}", model)
        for stamp, model in found.items()
    }


class _Framed(Struct):
    frames: Stamps = ()


class _Moving(Struct):
    model: list[_Framed] = []


def read_frames(path: Path) -> tuple[int, ...]:
    """The sender stamps at which a map has models, in order; none for a file that another check refuses."""
    file = find_map(path)
    try:
        models = converted(file, document_of(file), _Moving).model
    except InputError:
        return ()
    found = {stamp for model in models for stamp in model.frames}
    return tuple(sorted(found)) if len(found) <= MAX_FRAMES else ()


def read_obstacles(path: Path) -> dict[str, list[Line]]:
    """The lines of each obstacle of the map in a folder (its `map.json`) or of the map file itself, in metres.

    Obstacles of one name are one; one without a name is named by its number. Raises InputError.
    """
    file = find_map(path)
    document, found = converted(file, document_of(file), dict), dict[str, list[Line]]()
    if isinstance(listed := document.get("obstacles"), list):
        document = {"obstacles": [*map(_with_list, listed)]}
    for number, obstacle in enumerate(_entries(file, document, "obstacles", Obstacle, _raised), 1):
        lines = [((x1, y1), (x2, y2)) for x1, y1, x2, y2 in obstacle.lines]
        found.setdefault(obstacle.name or numbered(number), []).extend(lines)
    if (count := sum(map(len, found.values()))) > MAX_LINES:
        what, hint = f"{count} lines of obstacles, expected at most {MAX_LINES}", "write long lines, and fewer of them"
        raise InputError(file, what, "$.obstacles", hint=hint)
    return found


def _with_list(obstacle: Any) -> Any:
    """An obstacle whose only line has a list around it, which maps may leave out."""
    lines = obstacle.get("lines") if isinstance(obstacle, dict) else None
    is_one = isinstance(lines, list) and lines and not isinstance(lines[0], list)
    return {**obstacle, "lines": [lines]} if is_one else obstacle


def numbered(number: int) -> str:
    return f"obstacle-{number}"


def read_footprints(path: Path, height: float) -> dict[str, list[Outline]]:
    file = find_map(path)
    return footprints(_entries(file, document_of(file), "block", BlockEntry, _raised), height)


def footprints(blocks: Iterable[BlockEntry], height: float = HIGHEST) -> dict[str, list[Outline]]:
    """Each block entry's name, and the four corners (m) of its blocks in the way of a vehicle of ``height`` m.

    A name without such a block has an empty list.
    """
    found: dict[str, list[Outline]] = {}
    for block in blocks:
        reach = block.dimension[2] / 2
        standing = [i for i in block.instances if i.z + reach > LOWEST and i.z - reach < height]
        found.setdefault(block.name, []).extend(_outline(block, instance) for instance in standing)
    return found


def _outline(block: BlockEntry, instance: Instance) -> Outline:
    cos, sin = math.cos(math.pi - instance.angle), math.sin(math.pi - instance.angle)
    along, across = block.dimension[0] / 2, block.dimension[1] / 2
    corners = ((f * along, s * across) for f, s in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return tuple((instance.x + u * cos - v * sin, instance.y + u * sin + v * cos) for u, v in corners)
