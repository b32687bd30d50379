"""Flat convex pieces of the surroundings (floors, walls, boxes), in one colour or textured."""

import math
from dataclasses import dataclass, replace

import numpy as np

from dodo_dsl.opendlv.inputs.map_file import Instance
from services.scene.camera import Array
from services.scene.draw.raster import Colour
from services.scene.map.textures import Texture


@dataclass(frozen=True, eq=False)
class TextureMap:
    """Where a texture lies in the world: its first corner and the edges of one tile, each (3,), in m.

    ``shade`` is what the light leaves of its brightness.
    """

    texture: Texture
    corner: Array
    along: Array
    up: Array
    shade: float = 1.0


@dataclass(frozen=True, eq=False)
class Face:
    """A convex polygon ``points`` (k, 3) in world m, seen from where ``normal . p > offset`` only.

    ``owner`` is the number of the model's copy that it belongs to, if any.
    """

    points: Array
    normal: Array
    offset: float
    paint: Colour | TextureMap
    owner: int = -1

    def part(self, points: Array) -> "Face":
        return replace(self, points=points)

    def shaded(self, shade: float) -> "Face":
        """The same face, made darker (or brighter) by a factor."""
        if shade == 1.0:
            return self
        if isinstance(self.paint, TextureMap):
            return replace(self, paint=replace(self.paint, shade=self.paint.shade * shade))
        *colour, alpha = self.paint
        return replace(self, paint=(*(min(part * shade, 255.0) for part in colour), alpha))


def rotation_of(angle: float) -> Array:
    """The rotation (3, 3) of an OpenDLV instance: half a turn less its angle, about z."""
    c, s = math.cos(math.pi - angle), math.sin(math.pi - angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Covering:
    """What boxes are covered with: a texture whose tile measures ``tile`` m, None for once a side."""

    texture: Texture
    tile: tuple[float, float] | None


# per side of the unit cube: its axis, its sign, then the axes along and up its texture
_SIDES = [(2, 1, 0, 1), (2, -1, 0, 1), (1, 1, 0, 2), (1, -1, 0, 2), (0, 1, 1, 2), (0, -1, 1, 2)]


def _side(
    dimension: Array, rotation: Array, centre: Array, side: tuple[int, int, int, int], cover: Colour | Covering
) -> Face:
    axis, sign, first, second = side
    half = dimension / 2
    middle, along, up = np.zeros(3), np.zeros(3), np.zeros(3)
    middle[axis], along[first], up[second] = sign * half[axis], half[first], half[second]
    corners = np.array([middle - along - up, middle + along - up, middle + along + up, middle - along + up])
    normal = rotation @ (middle / half[axis])
    points = corners @ rotation.T + centre
    paint: Colour | TextureMap
    if isinstance(cover, Covering):
        wide, high = cover.tile or (dimension[first], dimension[second])
        tile_along, tile_up = rotation @ (along / half[first] * wide), rotation @ (up / half[second] * high)
        paint = TextureMap(cover.texture, points[0], tile_along, tile_up)
    else:
        paint = cover
    return Face(points, normal, float(normal @ points[0]), paint)


def box_faces(dimension: tuple[float, ...], instance: Instance, cover: Colour | Covering) -> list[Face]:
    """The six sides of a box that is centred on the instance, seen from outside."""
    rotation, centre = rotation_of(instance.angle), np.array(instance.position)
    return [_side(np.array(dimension), rotation, centre, side, cover) for side in _SIDES]
