"""A map loaded for drawing: shapes and where they stand, flat faces, colours of sky and ground.

Lines of its obstacles may be tape on the ground, background clutter may be boxes of all colours that stand around what
it holds, and models may stand next to their places, as people put them down; clutter and places are the same ones for
the same seed.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.map_file import (
    BlockEntry,
    Line,
    MapFile,
    ModelEntry,
    OverlayEntry,
    find_map,
    read_map,
)
from dodo_dsl.opendlv.assets.problem import InputError
from services.scene.bodies import Copies
from services.scene.camera import Array
from services.scene.meshes import load_obj, load_painted
from services.scene.raster import Colour
from services.scene.shading import Light
from services.scene.shape import Shape, make_shape
from services.scene.surfaces import Covering, Face, TextureMap, box_faces
from services.scene.textures import CANVAS, Texture, default_ground, load_picture

TAPE: Colour = (235.0, 235.0, 235.0, 255.0)
THICKNESS = 0.0002
"""How high above z = 0 tape lies, in m: enough to be above the floor, and less than a model notices."""


def picked_lines(path: Path, names: Sequence[str]) -> list[Line]:
    """The lines of a map's obstacles with these names; InputError when one is not there."""
    known = map_file.read_obstacles(find_map(path)) if names else {}
    for name in names:
        if name not in known:
            have = ", ".join(sorted(known)) or "none"
            raise InputError(find_map(path), f"there is no obstacle '{name}' with lines; the map has {have}")
    return [line for name, lines in known.items() if name in names for line in lines]


def line_faces(lines: Sequence[Line], width: float) -> Iterator[Face]:
    """A flat strip of ``width`` m for each line that has a length."""
    for (x1, y1), (x2, y2) in lines:
        start, end = np.array([x1, y1, THICKNESS]), np.array([x2, y2, THICKNESS])
        length = float(np.linalg.norm(end - start))
        if length > 0.0:
            along = (end - start) / length
            side = np.array([-along[1], along[0], 0.0]) * width / 2
            points = np.array([start - side, end - side, end + side, start + side])
            yield Face(points, np.array([0.0, 0.0, 1.0]), THICKNESS, TAPE)


KINDS = 8
"""The most sizes and colours; boxes of a kind are drawn together."""
NEAREST, FARTHEST = 0.5, 3.0
"""How far from the rectangle around all models the boxes stand, in m."""
_SIDES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def _box(width: float, depth: float, height: float) -> Shape:
    x, y = width / 2, depth / 2
    low = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]
    vertices = np.array(low + [[a, b, height] for a, b, _ in low])
    triangles = np.concatenate([_SIDES[:, [0, 1, 2]], _SIDES[:, [0, 2, 3]]])
    return make_shape(vertices, triangles)


def _extent(models: tuple[Copies, ...]) -> tuple[Array, Array]:
    places = [copies.positions[:, :2] for copies in models]
    if not places:
        return np.zeros(2), np.zeros(2)
    everything = np.concatenate(places)
    return everything.min(axis=0), everything.max(axis=0)


def _places(random: np.random.RandomState, count: int, low: Array, high: Array) -> Array:
    """Points (count, 3) on z = 0, spread along the rectangle around low and high, some distance from it."""
    reach = random.uniform(NEAREST, FARTHEST, count)
    size = high - low
    along = random.uniform(0, 1, count) * 2 * (size.sum() + 4 * FARTHEST)
    lengths = np.array([size[0], size[1], size[0], size[1]]) + 2 * FARTHEST
    side = np.minimum(np.searchsorted(np.cumsum(lengths), along, side="right"), 3)
    offset = along - np.concatenate([[0.0], np.cumsum(lengths)])[side] - FARTHEST
    x = np.choose(side, [low[0] + offset, high[0] + reach, high[0] - offset, low[0] - reach])
    y = np.choose(side, [low[1] - reach, low[1] + offset, high[1] + reach, high[1] - offset])
    return np.column_stack([x, y, np.zeros(count)])


def clutter(count: int, seed: int, around: tuple[Copies, ...]) -> tuple[Copies, ...]:
    """``count`` boxes outside the rectangle that holds all models ``around``; none of them has a name."""
    if count == 0:
        return ()
    random = np.random.RandomState([2902, seed])
    places = _places(random, count, *_extent(around))
    turns = random.uniform(0, np.pi, count)
    models = []
    for kind in range(min(KINDS, count)):
        sizes, colour = random.uniform([0.06, 0.06, 0.06], [0.6, 0.6, 0.9]), random.uniform(10, 250, 3)
        members = np.arange(kind, count, KINDS)
        models.append(Copies(_box(*sizes.tolist()), colour, places[members], turns[members]))
    return tuple(models)


_STREAM = 5711
"""Other random numbers than those of the clutter and the noise of the same seed."""


def displaced(models: tuple[Copies, ...], reach: float, seed: int) -> tuple[Copies, ...]:
    """Each copy moved along the ground to a point of the disc of ``reach`` (m) around its place, all alike likely.

    A larger reach moves it further in the same direction, so that what depends on the reach does so without jumps.
    """
    return tuple(_moved(models, reach, seed)) if reach else models


def _moved(models: tuple[Copies, ...], reach: float, seed: int) -> Iterator[Copies]:
    random = np.random.RandomState([_STREAM, seed])
    for copies in models:
        share = np.sqrt(random.uniform(0, 1, len(copies.positions)))
        direction = random.uniform(0, 2 * np.pi, len(copies.positions))
        ahead, left = reach * share * np.cos(direction), reach * share * np.sin(direction)
        yield replace(copies, positions=copies.positions + np.column_stack([ahead, left, np.zeros_like(ahead)]))


SKY: Colour = (206.0, 190.0, 176.0, 255.0)
GROUND: Colour = (112.0, 114.0, 116.0, 255.0)
_GROUND_REACH = 40.0
MAX_TRIANGLES = 200_000
MAX_TEXTURE_BYTES = 1 << 30
"""Of all models and blocks of a map together."""


@dataclass(frozen=True)
class SceneOptions:
    """What a scene has beyond its map: the light, lines of these obstacles on the ground, boxes around it, and how far
    (m) its models stand from their places."""

    light: Light = field(default_factory=Light.usual)
    lines: tuple[str, ...] = ()
    line_width: float = 0.02
    clutter: int = 0
    displaced: float = 0.0
    seed: int = 0
    own: int | None = None
    """Sender stamp of the vehicle itself, which does not see its own model."""


@dataclass(frozen=True, eq=False)
class Scene:
    """All that can be seen, in the world frame; ``sky`` and ``ground`` are what is behind the faces."""

    models: tuple[Copies, ...]
    faces: tuple[Face, ...]
    sky: Colour = SKY
    ground: Colour = GROUND
    light: Light = field(default_factory=Light.usual)
    overlays: tuple[OverlayEntry, ...] = ()


def _bgr(colour: tuple[float, float, float]) -> Array:
    return np.array(colour[::-1]) * 255.0


@dataclass
class _Budget:
    """What the meshes and textures of one map may take together; ``take`` raises InputError."""

    path: Path
    most: int
    what: str
    taken: int = 0

    def take(self, amount: int) -> None:
        self.taken += amount
        if self.taken > self.most:
            raise InputError(self.path, f"more than {self.most} {self.what} in all")


def _models(
    entry: ModelEntry, own: int | None, triangles: _Budget, shapes: dict[tuple[Path, bool], tuple[Shape, int]]
) -> Iterator[Copies]:
    """The copies that stand and those that move, without that of the vehicle itself, whose frames come under ``own``.

    ``shapes`` are those of the files that were read; several models of a map have one in different colours.
    """
    stamps = tuple(stamp for stamp in entry.frames if stamp != own)
    if not entry.instances and not stamps:
        return
    paint, key = entry.paint, (entry.file, entry.paint is None)
    shape, count = shapes[key] = shapes.get(key) or _shape(entry, triangles.path.parent)
    colour = np.zeros(3) if shape.colours is None else shape.colours
    if paint is not None:
        colour = np.array(Texture(load_picture(paint), 0).mean) if isinstance(paint, Path) else _bgr(paint)
    triangles.take(count)
    if entry.instances:
        positions = np.array([instance.position for instance in entry.instances])
        turns = np.array([math.pi - instance.angle for instance in entry.instances])
        yield Copies(shape, colour, positions, turns, entry.name)
    if stamps:
        yield Copies(shape, colour, np.zeros((len(stamps), 3)), np.zeros(len(stamps)), entry.name, stamps)


def _shape(entry: ModelEntry, folder: Path) -> tuple[Shape, int]:
    mesh = load_painted(entry.file, folder) if entry.paint is None else load_obj(entry.file)
    return make_shape(*mesh), len(mesh[1])


Textures = dict[tuple[Path, int], Texture]
"""By file and repeats: blocks of many sizes often have one."""


def _cover(entry: BlockEntry, memory: _Budget, known: Textures) -> Colour | Covering:
    if entry.texture_file is None:
        return (*_bgr(entry.color or (0.0, 0.0, 0.0)).tolist(), 255.0)
    tile = entry.texture_size
    repeats = math.ceil(max(entry.dimension) / min(tile)) if tile else 1
    key = entry.texture_file, min(repeats, CANVAS)
    if key not in known:
        known[key] = Texture(load_picture(entry.texture_file), repeats)
        memory.take(known[key].size)
    return Covering(known[key], tile)


def _default_floor() -> Face:
    r = _GROUND_REACH
    points = np.array([[-r, -r, 0.0], [r, -r, 0.0], [r, r, 0.0], [-r, r, 0.0]])
    lie = TextureMap(Texture(default_ground()), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    return Face(points, np.array([0.0, 0.0, 1.0]), 0.0, lie)


def _block_faces(entry: BlockEntry, memory: _Budget, known: Textures) -> list[Face]:
    cover = _cover(entry, memory, known)
    return [face for i in entry.instances for face in box_faces(entry.dimension, i, cover)]


def _faces(entries: MapFile, options: SceneOptions) -> Iterator[Face]:
    memory = _Budget(entries.path, MAX_TEXTURE_BYTES, "bytes of textures")
    known: Textures = {}
    blocks = [face for block in entries.blocks for face in _block_faces(block, memory, known)]
    lines = picked_lines(entries.path, options.lines)
    for face in [*(blocks or [_default_floor()]), *line_faces(lines, options.line_width)]:
        yield face.shaded(options.light.on(face.normal))


def load_scene(path: Path, options: SceneOptions | None = None) -> Scene:
    """The map in a folder, or of a ``map.json``, with its models and textures; raises InputError."""
    entries, options = read_map(path), options or SceneOptions()
    triangles = _Budget(entries.path, MAX_TRIANGLES, "triangles of models")
    shapes: dict[tuple[Path, bool], tuple[Shape, int]] = {}
    everything = [copies for e in entries.models for copies in _models(e, options.own, triangles, shapes)]
    models = tuple(copies for copies in everything if not copies.stamps)
    moving = tuple(copies for copies in everything if copies.stamps)
    around = clutter(options.clutter, options.seed, models)
    shade = options.light.on(np.array([0.0, 0.0, 1.0]))
    return Scene(
        models=displaced(models, options.displaced, options.seed) + around + moving,
        faces=tuple(_faces(entries, options)),
        ground=(*(min(part * shade, 255.0) for part in GROUND[:3]), 255.0),
        light=options.light,
        overlays=entries.overlays,
    )
