"""A map loaded for drawing: shapes and where they stand, flat faces, colours of sky and ground."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dodo_dsl.opendlv.inputs.json_node import MapError
from dodo_dsl.opendlv.inputs.map_file import BlockEntry, MapFile, ModelEntry, OverlayEntry, Vector3, read_map
from services.scene.camera import Array
from services.scene.draw.copies import Copies
from services.scene.draw.faces import Covering, Face, TextureMap, box_faces
from services.scene.draw.light import Light
from services.scene.draw.lines import line_faces, pick
from services.scene.draw.raster import Colour
from services.scene.draw.shape import Shape, make_shape
from services.scene.map.clutter import clutter
from services.scene.map.displaced import displaced
from services.scene.map.meshes import load_obj
from services.scene.map.textures import Texture, default_ground, load_picture

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


@dataclass(frozen=True, eq=False)
class Scene:
    """All that can be seen, in the world frame; ``sky`` and ``ground`` are what is behind the faces."""

    models: tuple[Copies, ...]
    faces: tuple[Face, ...]
    sky: Colour = SKY
    ground: Colour = GROUND
    light: Light = field(default_factory=Light.usual)
    overlays: tuple[OverlayEntry, ...] = ()


def _bgr(colour: Vector3) -> Array:
    return np.array(colour[::-1]) * 255.0


@dataclass
class _Budget:
    """What the meshes and textures of one map may take together; ``take`` raises MapError."""

    path: Path
    most: int
    what: str
    taken: int = 0

    def take(self, amount: int) -> None:
        self.taken += amount
        if self.taken > self.most:
            raise MapError(self.path, f"more than {self.most} {self.what} in all")


def _model(entry: ModelEntry, triangles: _Budget, shapes: dict[Path, tuple[Shape, int]]) -> Copies:
    """``shapes`` are those of the files that were read; several models of a map have one in different colours."""
    paint = entry.paint
    colour = np.array(Texture(load_picture(paint), 0).mean) if isinstance(paint, Path) else _bgr(paint)
    positions = np.array([instance.position for instance in entry.instances])
    turns = np.array([math.pi - instance.angle for instance in entry.instances])
    shape, count = shapes[entry.file] = shapes.get(entry.file) or _shape(entry.file)
    triangles.take(count)
    return Copies(shape, colour, positions, turns, entry.name)


def _shape(file: Path) -> tuple[Shape, int]:
    """The shape in an OBJ file, and how many triangles it is made of."""
    mesh = load_obj(file)
    return make_shape(*mesh), len(mesh[1])


def _cover(entry: BlockEntry, memory: _Budget) -> Colour | Covering:
    if not isinstance(entry.paint, Path):
        return (*_bgr(entry.paint).tolist(), 255.0)
    tile = entry.tile
    repeats = math.ceil(max(entry.dimension) / min(tile)) if tile else 1
    texture = Texture(load_picture(entry.paint), repeats)
    memory.take(texture.size)
    return Covering(texture, tile)


def _default_floor() -> Face:
    """What a map without blocks stands on: a large patterned square at z = 0."""
    r = _GROUND_REACH
    points = np.array([[-r, -r, 0.0], [r, -r, 0.0], [r, r, 0.0], [-r, r, 0.0]])
    lie = TextureMap(Texture(default_ground()), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    return Face(points, np.array([0.0, 0.0, 1.0]), 0.0, lie)


def _block_faces(entry: BlockEntry, memory: _Budget) -> list[Face]:
    cover = _cover(entry, memory)
    return [face for i in entry.instances for face in box_faces(entry.dimension, i, cover)]


def _faces(entries: MapFile, options: SceneOptions) -> Iterator[Face]:
    memory = _Budget(entries.path, MAX_TEXTURE_BYTES, "bytes of textures")
    blocks = [face for block in entries.blocks for face in _block_faces(block, memory)]
    lines = pick(entries.path, options.lines)
    for face in [*(blocks or [_default_floor()]), *line_faces(lines, options.line_width)]:
        yield face.shaded(options.light.on(face.normal))


def load_scene(path: Path, options: SceneOptions | None = None) -> Scene:
    """The map in a folder, or of a ``map.json``, with its models and textures; raises MapError."""
    entries, options = read_map(path), options or SceneOptions()
    triangles = _Budget(entries.path, MAX_TRIANGLES, "triangles of models")
    shapes: dict[Path, tuple[Shape, int]] = {}
    models = tuple(_model(entry, triangles, shapes) for entry in entries.models)
    around = clutter(options.clutter, options.seed, models)
    shade = options.light.on(np.array([0.0, 0.0, 1.0]))
    return Scene(
        models=displaced(models, options.displaced, options.seed) + around,
        faces=tuple(_faces(entries, options)),
        ground=(*(min(part * shade, 255.0) for part in GROUND[:3]), 255.0),
        light=options.light,
        overlays=entries.overlays,
    )
