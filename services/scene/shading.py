"""Copies of a shape in front of a camera as flat pieces: shaded, projected, ready to be filled.

The light has a direction, and says how bright it leaves a surface.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import cv2
import numpy as np

from services.scene.camera import Array, View
from services.scene.raster import HALF_PIXEL, Colour, Fixed, fixed, inset
from services.scene.shape import Shape

AMBIENT, DIFFUSE = 0.62, 0.38
DIRECTION = np.array([-0.35, -0.25, 0.9]) / np.linalg.norm([-0.35, -0.25, 0.9])
"""The direction towards the light, in the world, by default."""


def direction_of(azimuth: float, elevation: float) -> Array:
    """The unit vector (3,) at an azimuth, counter-clockwise from the world's x axis, and an elevation; in rad."""
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


@dataclass(frozen=True, eq=False)
class Light:
    """``direction`` (3,) points towards the light; ``on_blocks`` says whether it shades blocks and the ground too.

    Without a chosen light a map's blocks are shown in their own colours.
    """

    direction: Array
    ambient: float
    diffuse: float
    on_blocks: bool

    @classmethod
    def usual(cls) -> Self:
        return cls(DIRECTION, AMBIENT, DIFFUSE, False)

    @classmethod
    def of_flags(cls, azimuth: float | None, elevation: float | None, ambient: float | None) -> Self:
        """From angles in deg and the share of light from everywhere; None for the usual value."""
        if azimuth is None and elevation is None and ambient is None:
            return cls.usual()
        x, y, z = DIRECTION.tolist()
        across = math.atan2(y, x) if azimuth is None else math.radians(azimuth)
        up = math.asin(z) if elevation is None else math.radians(elevation)
        share = AMBIENT if ambient is None else ambient
        return cls(direction_of(across, up), share, 1.0 - share, True)

    def shades(self, cosines: Array) -> Array:
        """Lambert's cosine law for the cosines of any shape between normals and the light."""
        return np.asarray(self.ambient + self.diffuse * np.maximum(cosines, 0.0), np.float64)

    def on(self, normal: Array) -> float:
        """The shade of a block's side with a unit ``normal`` (3,)."""
        return float(self.shades(normal @ self.direction)) if self.on_blocks else 1.0


Piece = tuple[Fixed, Colour]


@dataclass(frozen=True, eq=False)
class Group:
    """``n`` copies of a shape seen by a camera.

    ``turn`` (n, 3, 3) and ``shift`` (n, 3) take the shape's frame to the camera's; ``eye`` and
    ``towards`` (n, 3) are the camera's place and the direction to the light in the shape's frame.
    """

    view: View
    shape: Shape
    colour: Array
    turn: Array
    shift: Array
    eye: Array
    towards: Array
    light: Light


def gather(view: View, shape: Shape, colour: Array, positions: Array, turns: Array, light: Light) -> Group:
    """The copies at ``positions`` (n, 3), turned by ``turns`` (n,) rad about z."""
    rotation = np.zeros((len(turns), 3, 3))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(turns)
    rotation[:, 1, 0] = np.sin(turns)
    rotation[:, 0, 1] = -rotation[:, 1, 0]
    rotation[:, 2, 2] = 1.0
    turn = view.axes @ rotation
    shift = view.to_camera(positions)
    eye = np.einsum("ni,nij->nj", view.position - positions, rotation)
    return Group(view, shape, colour, turn, shift, eye, light.direction @ rotation, light)


def _in_camera(group: Group, vertices: Array) -> Array:
    return np.asarray(vertices @ group.turn.transpose(0, 2, 1) + group.shift[:, None], np.float64)


def _thinned(group: Group) -> Array:
    """Vertices (n, V, 3) with all faces moved inwards by what filling adds: half a pixel."""
    depth = group.shift @ [0.0, 0.0, 1.0] + (group.turn @ group.shape.middle)[:, 2]
    amount = np.clip(HALF_PIXEL * depth / group.view.camera.focal, 0.0, group.shape.thickness)
    return np.asarray(group.shape.vertices - amount[:, None, None] * group.shape.mitres, np.float64)


def _facing(group: Group) -> Array:
    """The camera's distance (n, F) from each face's plane; positive where the face shows its front."""
    offsets = np.einsum("fi,fi->f", group.shape.normals, group.shape.centres)
    return np.asarray(group.eye @ group.shape.normals.T - offsets, np.float64)


def _shades(group: Group) -> Array:
    """The light (n, F) of each face by Lambert's cosine law, and some from everywhere."""
    return group.light.shades(group.towards @ group.shape.normals.T)


def _paint(colour: Array, shades: Array) -> list[Any]:
    """B, G, R, A of shades of any shape, as nested lists."""
    lit = np.rint(np.minimum(colour * shades[..., None], 255.0))
    opaque = np.full((*shades.shape, 1), 255.0)
    return list(np.concatenate([lit, opaque], axis=-1).tolist())


def _orders(group: Group) -> list[list[int]]:
    """For each copy the faces that show their front, the farthest first."""
    away = ((group.shape.centres - group.eye[:, None]) ** 2).sum(axis=2)
    order = np.argsort(-away, axis=1, kind="stable")
    shown = np.take_along_axis(_facing(group), order, axis=1) > 0.0
    return [faces[front].tolist() for faces, front in zip(order, shown, strict=True)]


def silhouettes(group: Group) -> list[list[Piece]]:
    """Each copy as the convex hulls of its outlines, in the mean colour of what shows."""
    seen = np.maximum(_facing(group), 0.0) * group.shape.areas + 1e-12
    if group.colour.ndim == 1:
        colours = _paint(group.colour, (seen * _shades(group)).sum(axis=1) / seen.sum(axis=1))
    else:
        share = seen * _shades(group) / seen.sum(axis=1, keepdims=True)
        colours = _paint(share @ group.colour, np.ones(len(share)))
    corners = fixed(group.view.camera.project(_in_camera(group, _thinned(group))))
    hulls = [[cv2.convexHull(each[part]) for part in group.shape.outlines] for each in corners]
    return [[(hull, colour) for hull in parts] for parts, colour in zip(hulls, colours, strict=True)]


def whole(group: Group) -> list[list[Piece]]:
    """Each copy, all of it before the near plane, as its faces."""
    points = _in_camera(group, _thinned(group))
    corners = np.take(fixed(group.view.camera.project(points)), group.shape.faces, axis=1)
    colours = _paint(group.colour, _shades(group))
    return [[(corners[i, f], colours[i][f]) for f in order] for i, order in enumerate(_orders(group))]


def cut(group: Group) -> list[list[Piece]]:
    """Each copy as what of its faces lies inside the frustum."""
    points, view = _in_camera(group, group.shape.vertices[None]), group.view
    colours = _paint(group.colour, _shades(group))
    result: list[list[Piece]] = []
    for i, order in enumerate(_orders(group)):
        parts = [(f, view.visible_part(points[i, group.shape.faces[f]])) for f in order]
        shown = [(f, fixed(inset(view.camera.project(part)))) for f, part in parts if len(part) > 2]
        result.append([(corners, colours[i][f]) for f, corners in shown])
    return result
