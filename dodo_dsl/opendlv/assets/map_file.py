"""An OpenDLV ``map.json``, checked, and its obstacles as an evaluator needs them: named lines on the ground.

Models and textures are not loaded yet.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from dodo_dsl.opendlv.assets import mesh_text
from dodo_dsl.opendlv.assets.json_file import MAX_NUMBER, Node, read_bytes, unread
from dodo_dsl.opendlv.assets.problem import InputError

MAX_INSTANCES = 100_000
MAX_BLOCKS = 500
_TURN = 6.3
"""rad"""
MAX_FRAMES = 100
MAX_STAMP = 2**32 - 1
FRAME_TURN = math.pi / 2
"""A model at a frame is turned by the frame's yaw and this, in rad about z: it looks along its own -y."""
NO_BODIES = "no model of the map has 'frames' of other sender stamps than the vehicle's"
MAX_OVERLAYS = 50
"""Places of overlays, each of which takes the memory of an image."""

Vector3 = tuple[float, float, float]
Paint = Vector3 | Path
"""A colour as r, g, b from 0 to 1, or the file of a texture."""


@dataclass(frozen=True)
class Instance:
    """Where a thing stands: its position in m, its OpenDLV angle in rad (0 is half a turn, then clockwise)."""

    position: Vector3
    angle: float


@dataclass(frozen=True)
class ModelEntry:
    """An OBJ file, its paint, and where copies of it stand; one more is at the frame of each sender stamp.

    Without paint it has the materials of its file.
    """

    name: str
    file: Path
    paint: Paint | None
    instances: tuple[Instance, ...]
    frames: tuple[int, ...] = ()

    def footprint(self) -> list[tuple[float, float]]:
        """The model's convex outline from above, at a frame at the origin that looks along x; raises InputError."""
        cos, sin = math.cos(FRAME_TURN), math.sin(FRAME_TURN)
        return [(cos * x - sin * y, sin * x + cos * y) for x, y in mesh_text.outline(self.file)]


@dataclass(frozen=True)
class BlockEntry:
    """A box, ``dimension`` in m and centred on each instance; ``tile`` is the size of its texture in m."""

    name: str
    dimension: Vector3
    paint: Paint
    tile: tuple[float, float] | None
    instances: tuple[Instance, ...]


@dataclass(frozen=True)
class OverlayEntry:
    """An image laid over the camera's: its size and positions (upper left corners) as fractions of that image."""

    name: str
    file: Path
    size: tuple[float, float]
    places: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class MapFile:
    """Everything to draw; things without instances are left out."""

    path: Path
    models: tuple[ModelEntry, ...]
    blocks: tuple[BlockEntry, ...]
    overlays: tuple[OverlayEntry, ...] = ()


def _triple(node: Node, names: str) -> Vector3:
    a, b, c = node.numbers(names)
    return a, b, c


def _colour(node: Node) -> Vector3:
    colour = _triple(node, "r g b")
    if not all(0.0 <= part <= 1.0 for part in colour):
        node.fail("the numbers [r, g, b] between 0 and 1")
    return colour


def _paint(node: Node) -> Paint:
    texture, colour = node.member("textureFile"), node.member("color")
    if texture is not None:
        return texture.resource()
    return _colour(colour) if colour is not None else node.lacks("'color' or 'textureFile'")


def _instances(node: Node) -> tuple[Instance, ...]:
    rows = [item.numbers("x y z angle") for item in node.items("instances")]
    return tuple(Instance((x, y, z), angle) for x, y, z, angle in rows)


def _frames(node: Node) -> tuple[int, ...]:
    found: list[int] = []
    items = list(node.items("frames"))
    if len(items) > MAX_FRAMES:
        raise InputError(
            node.file, f"{len(items)} frames of a model, expected at most {MAX_FRAMES}", f"{node.place}.frames"
        )
    for item in items:
        if isinstance(item.value, bool) or not isinstance(item.value, int) or not 0 <= item.value <= MAX_STAMP:
            item.fail(f"a sender stamp, a whole number from 0 to {MAX_STAMP}")
        if item.value in found:
            raise InputError(item.file, f"the sender stamp {item.value} appears twice", item.place, hint="remove one")
        found.append(item.value)
    return tuple(found)


def _model(node: Node) -> ModelEntry | None:
    instances, frames = _instances(node), _frames(node)
    if not instances and not frames:
        return None
    file = node.required("file").resource()
    has_materials = not (_has(node, "color") or _has(node, "textureFile")) and b"usemtl" in read_bytes(file)
    paint = None if has_materials else _paint(node)
    return ModelEntry(node.required("name").text(), file, paint, instances, frames)


def _positive(node: Node, names: str) -> tuple[float, ...]:
    numbers = node.numbers(names)
    if min(numbers) <= 0.0:
        node.fail(f"the numbers [{', '.join(names.split())}], all greater than 0")
    return numbers


def _block(node: Node) -> BlockEntry | None:
    instances = _instances(node)
    if not instances:
        return None
    width, depth, height = _positive(node.required("dimension"), "x y z")
    size = node.member("textureSize")
    tile = None
    if size is not None:
        along, up = _positive(size, "width height")
        tile = (along, up)
    dimension = (width, depth, height)
    return BlockEntry(node.required("name").text(), dimension, _paint(node), tile, instances)


def _overlay(node: Node) -> OverlayEntry | None:
    rows = [item.numbers(_names(item, "x y")) for item in node.items("instances")]
    if not rows:
        return None
    wide, high = _positive(node.required("dimension"), "width height")
    if max(wide, high) > 1.0:
        node.required("dimension").fail("the numbers [width, height], fractions of the image up to 1")
    file = node.required("textureFile").resource()
    places = tuple((row[0], row[1]) for row in rows)
    return OverlayEntry(node.required("name").text(), file, (wide, high), places)


def _names(item: Node, names: str) -> str:
    """OpenDLV reads the first two numbers of an overlay's position; maps often write four as elsewhere."""
    return "x y z angle" if isinstance(item.value, list) and len(item.value) == 4 else names


def find_map(path: Path) -> Path:
    """The ``map.json`` of a map given as its folder or as the file itself."""
    return path / "map.json" if path.is_dir() else path


WALLS = ".txt"
"""The suffix of a map of older simulations, which has walls alone."""
_WALL = "a wall x1,y1,x2,y2; in m"


def load(file: Path) -> Node:
    """The document of a map; walls ``x1,y1,x2,y2;`` of a text file are its obstacles. Raises InputError."""
    if file.suffix != WALLS:
        return Node.load(file)
    lines = enumerate(read_bytes(file).decode(errors="replace").splitlines(), 1)
    walls = [_wall(file, wall, number) for number, line in lines for wall in line.split(";") if wall.strip()]
    if not walls:
        raise InputError(file, f"the file is empty, expected {_WALL}", line=1)
    return Node(file, "$", {"obstacles": [{"lines": [wall]} for wall in walls]})


def _wall(file: Path, text: str, line: int) -> list[float]:
    try:
        wall = [float(word) for word in text.split(",")]
    except ValueError:
        wall = []
    if len(wall) != 4 or not all(abs(value) <= MAX_NUMBER for value in wall):
        raise InputError(file, f"expected {_WALL}, found '{text.strip()[:60]}'", line=line, hint="as -2,0,2,0;")
    return wall


def read_map(path: Path) -> MapFile:
    """Reads and checks the map in a folder (or a ``map.json``); InputError names the file and the JSON path."""
    file = find_map(path)
    return _collected(file, load(file), _raised)


def bodies(models: Sequence[ModelEntry], own: int) -> dict[int, tuple[str, ModelEntry]]:
    """Name and model at each frame but the vehicle's ``own``; the frame distinguishes those of one name."""
    found = {stamp: model for model in models for stamp in model.frames if stamp != own}
    names = [model.name for model in found.values()]
    return {
        stamp: (model.name if names.count(model.name) == 1 else f"{model.name}/{stamp}", model)
        for stamp, model in found.items()
    }


def read_frames(path: Path) -> tuple[int, ...]:
    """The sender stamps at which a map has models, in order; none for a file that another check refuses."""
    file, found = find_map(path), set[int]()
    try:
        if b'"frames"' in read_bytes(file):
            for model in Node.load(file).items("model"):
                found.update(_frames(model))
    except InputError:
        return ()
    return tuple(sorted(found)) if len(found) <= MAX_FRAMES else ()


def problems(path: Path) -> tuple[MapFile | None, list[InputError]]:
    """What can be drawn of a map, None for what is not a map, and all that is wrong with it."""
    file, found = find_map(path), list[InputError]()
    try:
        root = load(file)
        read = _collected(file, root, found.append)
    except InputError as error:
        return None, [error]
    found.extend(unread_keys(root))
    found.extend(_degrees(read, root))
    return read, found


def unread_keys(root: Node) -> Iterator[InputError]:
    """Keys of a map that nothing reads; errors where those of an obstacle are meant."""
    yield from unread([root], _KEYS, ("obstacles",))
    for key, known in _KEYS.items():
        yield from unread(_listed(root, key), known, known if key == "obstacles" else ())


def _listed(root: Node, key: str) -> Iterator[Node]:
    """The entries of a list; none where it is not a list, which is reported elsewhere."""
    value = root.value.get(key) if isinstance(root.value, dict) else None
    yield from root.items(key) if isinstance(value, list) else ()


def _has(entry: Node, key: str) -> bool:
    return isinstance(entry.value, dict) and key in entry.value


def _degrees(read: MapFile, root: Node) -> Iterator[InputError]:
    """The first angle of more than a turn, which is hardly in radians."""
    for key in ("model", "block"):
        for item in _listed(root, key):
            rows = item.value.get("instances") if isinstance(item.value, dict) else None
            for index, row in enumerate(rows if isinstance(rows, list) else ()):
                angle = row[3] if isinstance(row, list) and len(row) == 4 else 0
                if isinstance(angle, int | float) and _TURN < abs(angle) <= MAX_NUMBER:
                    place = f"{item.place}.instances[{index}][3]"
                    what = f"the angle {angle:g} is more than a turn, expected radians"
                    hint = f"{angle:g} degrees are {math.radians(angle):.5g} rad"
                    yield InputError(read.path, what, place, hint=hint, is_slip=True)
                    return


_KEYS = {
    "model": ("name", "file", "color", "textureFile", "instances", "frames"),
    "block": ("name", "dimension", "color", "textureFile", "textureSize", "instances"),
    "overlay": ("name", "dimension", "textureFile", "instances"),
    "obstacles": ("name", "lines"),
}
"""What OpenDLV's maps have in each list."""
Entry = TypeVar("Entry")
Report = Callable[[InputError], None]


def _raised(error: InputError) -> None:
    raise error


def _collected(file: Path, root: Node, report: Report) -> MapFile:
    root.member("model")
    models = _last_of_each_frame(_entries(root, "model", _model, report))
    blocks = _entries(root, "block", _block, report)
    overlays = _entries(root, "overlay", _overlay, report)
    for key, what, count, limit in (
        ("model", "instances", sum(len(m.instances) for m in models), MAX_INSTANCES),
        ("model", "frames", sum(len(m.frames) for m in models), MAX_FRAMES),
        ("block", "instances", sum(len(b.instances) for b in blocks), MAX_BLOCKS),
        ("overlay", "instances", sum(len(o.places) for o in overlays), MAX_OVERLAYS),
    ):
        if count > limit:
            report(InputError(file, f"{count} {what} of {key}s, expected at most {limit}", f"$.{key}"))
    return MapFile(file, models, blocks, overlays)


def _last_of_each_frame(models: tuple[ModelEntry, ...]) -> tuple[ModelEntry, ...]:
    last = {frame: index for index, model in enumerate(models) for frame in model.frames}
    kept = (
        replace(model, frames=tuple(frame for frame in model.frames if last[frame] == index)) if model.frames else model
        for index, model in enumerate(models)
    )
    return tuple(model for model in kept if model.instances or model.frames)


def _entries(root: Node, key: str, read: Callable[[Node], Entry | None], report: Report) -> tuple[Entry, ...]:
    """The entries of a list that can be read; the others are reported."""
    found: list[Entry] = []
    try:
        for item in root.items(key):
            try:
                entry = read(item)
            except InputError as error:
                report(error)
            else:
                found.extend([] if entry is None else [entry])
    except InputError as error:
        report(error)
    return tuple(found)


Line = tuple[tuple[float, float], tuple[float, float]]
MAX_LINES = 10_000
"""Of all obstacles of a map, to each of which evaluators measure the distance."""


def read_obstacles(path: Path) -> dict[str, list[Line]]:
    """The lines of each obstacle of the map in a folder (its `map.json`) or of the map file itself, in metres.

    Obstacles of one name are one; one without a name is named by its number. Raises InputError.
    """
    root = load(path if path.suffix in (".json", WALLS) else path / "map.json")
    require_few_lines(root)
    found: dict[str, list[Line]] = {}
    for number, entry in enumerate(root.items("obstacles"), 1):
        name, lines = _named_lines(entry, numbered(number))
        found.setdefault(name, []).extend(lines)
    return found


def numbered(number: int) -> str:
    """What an obstacle without a name is called, the map's first being number 1."""
    return f"obstacle-{number}"


LOWEST, HIGHEST = 0.01, 0.15
"""m above the ground: a block that is lower is driven over; the Kiwi car is as high."""
Outline = tuple[tuple[float, float], ...]


def read_footprints(path: Path, height: float = HIGHEST) -> dict[str, list[Outline]]:
    """As ``footprints``, of the map in a folder or of a ``map.json``; raises InputError."""
    return footprints(_entries(load(find_map(path)), "block", _block, _raised), height)


def footprints(blocks: Iterable[BlockEntry], height: float = HIGHEST) -> dict[str, list[Outline]]:
    """Each block entry's name, and the four corners (m) of its blocks in the way of a vehicle of ``height`` m.

    A name without such a block has an empty list.
    """
    found: dict[str, list[Outline]] = {}
    for block in blocks:
        reach = block.dimension[2] / 2
        standing = [i for i in block.instances if i.position[2] + reach > LOWEST and i.position[2] - reach < height]
        found.setdefault(block.name, []).extend(_outline(block, instance) for instance in standing)
    return found


def _outline(block: BlockEntry, instance: Instance) -> Outline:
    cos, sin = math.cos(math.pi - instance.angle), math.sin(math.pi - instance.angle)
    (x, y, _), along, across = instance.position, block.dimension[0] / 2, block.dimension[1] / 2
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = ((f * along, s * across) for f, s in signs)
    return tuple((x + u * cos - v * sin, y + u * sin + v * cos) for u, v in corners)


def require_few_lines(root: Node) -> None:
    """Raises InputError for more lines than a map may have."""
    lines = [o.value.get("lines") for o in root.items("obstacles") if isinstance(o.value, dict)]
    if (count := sum(len(each) for each in lines if isinstance(each, list))) > MAX_LINES:
        what = f"{count} lines of obstacles, expected at most {MAX_LINES}"
        raise InputError(root.file, what, "$.obstacles", hint="write long lines in the place of many short ones")


def _named_lines(entry: Node, default: str) -> tuple[str, list[Line]]:
    name = entry.member("name")
    text = name.text() if name else default
    if name and text != text.strip():
        hint = f'write "{text.strip()}"' if text.strip() else ""
        name.fail("a name without blanks around it, as a test finds it", hint)
    lines = entry.required("lines")
    if not isinstance(lines.value, list) or not lines.value:
        lines.fail("a list of lines [x1, y1, x2, y2]")
    rows = [lines] if not isinstance(lines.value[0], list) else entry.items("lines")
    return text, [_line(row) for row in rows]


def _line(node: Node) -> Line:
    x1, y1, x2, y2 = node.numbers("x1 y1 x2 y2")
    return (x1, y1), (x2, y2)
