"""Draws the sky, the ground up to the horizon, and flat convex faces in one colour or textured.

Faces are those of the surroundings: floors, walls, boxes.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import Instance
from services.scene.camera import NEAR, Array, Pinhole, View, clip
from services.scene.raster import OVERLAPPING, Colour, Fixed, Image, fill, fill_fixed, fixed, inset
from services.scene.textures import Texture


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


_DEPTH = np.array([0.0, 0.0, 1.0])
_UNDER = 3.0
"""So many pixels below the horizon the sky ends: the ground hides that."""
_SHARPER = 0.3
"""Levels change this much (in octaves of resolution) later than where sizes match best."""


def draw_backdrop(image: Image, view: View, sky: Colour, ground: Colour) -> None:
    """Sky down to a little below the horizon, then ground wherever the line of sight falls."""
    camera = view.camera
    x, y = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
    rays = np.array([[-x, -y, 1.0], [x, -y, 1.0], [x, y, 1.0], [-x, y, 1.0]])
    above = clip(rays, view.axes[:, 2], _UNDER * float(np.linalg.norm(view.axes[:2, 2])) / camera.focal)
    if len(above):
        fill_fixed(image, fixed(camera.project(above)), sky)
    below = clip(rays, -view.axes[:, 2], 0.0)
    if len(below):
        fill(image, camera.project(below), ground)


Window = tuple[int, int, int, int]
"""The first and last-but-one columns and rows of some pixels."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A part of a face as it is drawn: within a window of the picture, in one colour or one level of a texture.

    ``outline`` is what is filled of the window, None for all of it. ``spot`` is the part in picture coordinates;
    ``inverse`` leads from there to tiles of a texture.
    """

    window: Window
    outline: Fixed | None
    paint: Colour | TextureMap
    spot: Array
    inverse: Array
    level: int = 0

    def cover(self, covered: Image) -> bool:
        """Marks the pixels (height, width) that are drawn; False if all of them were marked before."""
        left, right, top, bottom = self.window
        window = covered[top:bottom, left:right]
        if cv2.countNonZero(window) == window.size:
            return False
        if self.outline is None:
            window[:] = 255
        else:
            fill_fixed(window if isinstance(self.paint, TextureMap) else covered, self.outline, (255,))
        return True

    def draw(self, image: Image) -> None:
        """Draws over what is there."""
        if isinstance(self.paint, TextureMap):
            _draw_texture(image, self, self.paint)
        elif self.outline is not None:
            fill_fixed(image, self.outline, self.paint)


def patches(view: View, face: Face) -> Iterator[Patch]:
    """What of a face lies in the picture, in the order in which it is drawn."""
    visible = view.visible_part(view.to_camera(face.points))
    if len(visible) < 3:
        return
    if isinstance(face.paint, TextureMap):
        yield from _bands(view, visible, face.paint)
        return
    polygon = view.camera.project(visible)
    left, right, top, bottom = _window(view.camera, polygon)
    around = max(left - 1, 0), min(right + 1, view.camera.width), max(top - 1, 0), min(bottom + 1, view.camera.height)
    yield Patch(around, fixed(inset(polygon, OVERLAPPING)), face.paint, polygon, np.eye(3))


_FEW = 24
"""So many faces are drawn in less time than it takes to find out which are hidden."""
_NEARLY = 1e-9


class FaceTable:
    """Faces as one array, to find which of them are not hidden by others, and so have to be drawn."""

    def __init__(self, faces: Sequence[Face]) -> None:
        most = max((len(face.points) for face in faces), default=0)
        self._rows = {face: row for row, face in enumerate(faces)}
        self._points = np.array([[*face.points, *[face.points[-1]] * (most - len(face.points))] for face in faces])

    def shown(self, view: View, faces: Sequence[Face]) -> dict[Face, list[Patch]]:
        """Those of ``faces``, which are sorted from back to front, that show, each with what is to be drawn of it."""
        if len(faces) <= _FEW:
            return {face: list(patches(view, face)) for face in faces}
        covered = np.zeros((view.camera.height, view.camera.width), np.uint8)
        windows, found = self._windows(view), dict[Face, list[Patch]]()
        for face in reversed(faces):
            window = windows[self._rows[face]]
            if window is None or _is_covered(covered, window):
                continue
            if parts := [patch for patch in patches(view, face) if patch.cover(covered)]:
                found[face] = parts
        return found

    def _windows(self, view: View) -> list[Window | None]:
        """Pixels that hold each face, by its row; all of them where it is partly behind the camera, None for none."""
        camera, (count, most) = view.camera, self._points.shape[:2]
        points = view.to_camera(self._points.reshape(-1, 3))
        is_inside = (points @ camera.planes + camera.offsets >= -_NEARLY).reshape(count, most, -1)
        inside = np.asarray(np.asarray(is_inside.any(axis=1)).all(axis=1))
        depth = points[:, 2].reshape(count, most)
        is_before = np.all(depth > NEAR, axis=1, keepdims=True)
        points[:, 2] = np.maximum(points[:, 2], NEAR)
        spots = camera.project(points).reshape(count, most, 2)
        size = np.array([camera.width, camera.height])
        low = np.where(is_before, np.clip(np.floor(spots.min(axis=1)) - 1, 0, size - 1), 0).astype(int)
        high = np.where(is_before, np.clip(np.ceil(spots.max(axis=1)) + 2, 1, size), size).astype(int)
        rows = zip(inside.tolist(), low.tolist(), high.tolist(), strict=True)
        return [(left, right, top, bottom) if seen else None for seen, (left, top), (right, bottom) in rows]


def _is_covered(covered: Image, window: Window) -> bool:
    left, right, top, bottom = window
    part = covered[top:bottom, left:right]
    return cv2.countNonZero(part) == part.size


def cover_face(labels: npt.NDArray[np.int32], view: View, face: Face, label: int) -> None:
    """Writes a number wherever the face would be drawn."""
    visible = view.visible_part(view.to_camera(face.points))
    if len(visible) > 2:
        fill(labels, view.camera.project(visible), (label,), OVERLAPPING)


def _texture_to_picture(view: View, paint: TextureMap) -> Array:
    """The homography (3, 3) from tiles of the texture (s, t, 1) to picture coordinates times depth."""
    columns = [paint.along, paint.up, paint.corner - view.position]
    return view.camera.matrix @ view.axes @ np.stack(columns, axis=1)


def _band_limits(inverse: Array, texels: int, levels: int) -> list[float]:
    """Depths in m between which each level of the pyramid, the finest first, is the right one.

    A pixel at depth d covers |det inverse| d^3 square tiles, because its third component is 1 / d.
    """
    finest = 1.0 / (abs(float(np.linalg.det(inverse))) * texels)
    inner = [(finest * 4.0 ** (level + 0.5 + _SHARPER)) ** (1 / 3) for level in range(levels - 1)]
    return [0.0, *inner, math.inf]


def _bands(view: View, visible: Array, paint: TextureMap) -> Iterator[Patch]:
    """The parts of a face's visible part, by the level of its texture."""
    forward = _texture_to_picture(view, paint)
    if abs(float(np.linalg.det(forward))) < 1e-12:
        return
    inverse = np.linalg.inv(forward).astype(np.float64)
    tiles = paint.texture.tiles
    limits = _band_limits(inverse, tiles[0].shape[0] * tiles[0].shape[1], len(tiles))
    nearest, farthest = max(float(visible[:, 2].min()), NEAR), float(visible[:, 2].max())
    for level, (near, far) in enumerate(pairwise(limits)):
        if near < farthest and far > nearest:
            band = clip(visible, _DEPTH, -near)
            band = clip(band, -_DEPTH, far) if math.isfinite(far) else band
            if len(band) > 2:
                yield from _band(view.camera, view.camera.project(band), inverse, paint, level)


def _band(camera: Pinhole, polygon: Array, inverse: Array, paint: TextureMap, level: int) -> Iterator[Patch]:
    left, right, top, bottom = window = _window(camera, polygon)
    if left < right and top < bottom:
        is_whole = _fills_window(polygon, left, right, top, bottom)
        outline = None if is_whole else fixed(inset(polygon, OVERLAPPING) - [left, top])
        yield Patch(window, outline, paint, polygon, inverse, level)


def _window(camera: Pinhole, polygon: Array) -> Window:
    """The pixels whose centres a polygon may cover."""
    columns, rows = polygon.T.tolist()
    left, right = math.ceil(min(columns) - 1e-6), math.floor(max(columns) + 1e-6) + 1
    top, bottom = math.ceil(min(rows) - 1e-6), math.floor(max(rows) + 1e-6) + 1
    return max(left, 0), min(right, camera.width), max(top, 0), min(bottom, camera.height)


def _fills_window(polygon: Array, left: int, right: int, top: int, bottom: int) -> bool:
    """Whether all pixel centres of the window lie in the polygon (within a hundredth of a pixel)."""
    corners = ((left, top), (right - 1, top), (right - 1, bottom - 1), (left, bottom - 1))
    points: list[list[float]] = polygon.tolist()
    is_left = is_right = True
    for (x, y), (next_x, next_y) in pairwise([*points, points[0]]):
        along, up = next_x - x, next_y - y
        reach = 0.01 * math.hypot(along, up)
        sides = [along * (row - y) - up * (column - x) for column, row in corners]
        is_left, is_right = is_left and min(sides) >= -reach, is_right and max(sides) <= reach
    return is_left or is_right


def _draw_texture(image: Image, patch: Patch, paint: TextureMap) -> None:
    left, right, top, bottom = patch.window
    warp, canvas, border = _lookup(patch, paint)
    warp = warp @ np.array([[1.0, 0.0, left], [0.0, 1.0, top], [0.0, 0.0, 1.0]])
    window = image[top:bottom, left:right]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (right - left, bottom - top)
    if patch.outline is None:
        cv2.warpPerspective(canvas, warp, size, dst=window, flags=flags, borderMode=border)
        _shade(window, paint.shade)
        return
    picture = np.asarray(cv2.warpPerspective(canvas, warp, size, flags=flags, borderMode=border), np.uint8)
    _shade(picture, paint.shade)
    mask = np.zeros(window.shape[:2], np.uint8)
    fill_fixed(mask, patch.outline, (255,))
    cv2.copyTo(picture, mask, window)


def _shade(picture: Image, shade: float) -> None:
    if shade != 1.0:
        cv2.multiply(picture, np.array([shade, shade, shade, 1.0]), dst=picture)


def _lookup(patch: Patch, paint: TextureMap) -> tuple[Array, Image, int]:
    """From picture coordinates to texels: the homography, the picture that holds them, the border's mode.

    Whole tiles are taken off so that the polygon falls into the repeated canvas; where it is too
    large for that, a single tile is wrapped around, which is slower.
    """
    polygon, inverse = patch.spot, patch.inverse
    tile, canvas = paint.texture.tiles[patch.level], paint.texture.canvases[patch.level]
    height, width = tile.shape[:2]
    spots = np.column_stack([polygon, np.ones(len(polygon))]) @ inverse.T
    spots = spots[:, :2] / spots[:, 2:]
    first = np.floor(spots.min(axis=0) - 1.0 / np.array([width, height]))
    texel = np.array([[width, 0.0, -0.5], [0.0, height, -0.5], [0.0, 0.0, 1.0]])
    origin = np.array([[1.0, 0.0, -first[0]], [0.0, 1.0, -first[1]], [0.0, 0.0, 1.0]])
    extent = (spots.max(axis=0) - first) * [width, height] + 1
    fits = extent[0] <= canvas.shape[1] and extent[1] <= canvas.shape[0]
    return texel @ origin @ inverse, (canvas if fits else tile), (cv2.BORDER_REPLICATE if fits else cv2.BORDER_WRAP)
