"""What stands in a map at a height: outlines of its models, blocks and walls in the plane, and rays that meet them.

Lengths are in m, in the world's frame of reference. What a map has is cut once for each height at which a sensor looks.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.assets.map_file import (
    FRAME_TURN,
    BlockEntry,
    Instance,
    Line,
    MapFile,
    ModelEntry,
    read_map,
    read_obstacles,
)
from services.scene.meshes import Indices, is_closed, load_obj
from services.scene.scene import picked_lines

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.intp]

EVERY = "*"
"""As a wall: all obstacles but those that are none."""
_SLACK = 1e-9
"""By how much of its length a segment counts as longer, so that no ray slips through between two of them."""
_NEAR = 1e-6
"""A point so near to a segment, by its length, is on it; rays so near to one, by their increment, are tried."""
_HEIGHTS = 64
"""Heights whose cuts are kept."""


class Place(NamedTuple):
    """Where a body is in the world: position in m and heading in rad counter-clockwise from the x axis."""

    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True, eq=False)
class Cut:
    """Bodies in a plane, each some of the segments; a solid one has an inside.

    ``starts`` and ``edges`` (S, 2) are the segments, ``first`` (B,) and ``counts`` (B,) say which are a body's,
    ``centres`` (B, 2) and ``radii`` (B,) are circles around them.
    """

    starts: Array
    edges: Array
    first: Numbers
    counts: Numbers
    centres: Array
    radii: Array
    solid: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, bodies: Iterable[tuple[Array, bool]]) -> Self:
        """From the segments (n, 2, 2) of each body, and whether it is solid; what has no length is left out."""
        long = [(segments[(segments[:, 0] != segments[:, 1]).any(axis=1)], solid) for segments, solid in bodies]
        kept = [(segments, solid) for segments, solid in long if len(segments)]
        every = np.concatenate([np.zeros((0, 2, 2)), *(segments for segments, _ in kept)])
        counts = np.array([len(segments) for segments, _ in kept], np.intp)
        corners = [segments.reshape(-1, 2) for segments, _ in kept]
        centres = np.array([(c.min(axis=0) + c.max(axis=0)) / 2 for c in corners]).reshape(-1, 2)
        radii = np.array([np.hypot(*(c - m).T).max() for c, m in zip(corners, centres, strict=True)], np.float64)
        solid = np.array([solid for _, solid in kept], np.bool_)
        first = np.cumsum(counts) - counts
        return cls(every[:, 0], every[:, 1] - every[:, 0], first, counts, centres, radii * (1 + _SLACK), solid)

    @classmethod
    def joined(cls, cuts: Sequence["Cut"]) -> "Cut":
        if len(cuts) == 1:
            return cuts[0]
        lengths = [len(cut.starts) for cut in cuts]
        whole = {name: np.concatenate([getattr(cut, name) for cut in cuts]) for name in cls.__dataclass_fields__}
        whole["first"] += np.repeat(np.cumsum(lengths) - lengths, [len(cut.first) for cut in cuts])
        return cls(**whole)

    def moved(self, x: float, y: float, turn: float) -> "Cut":
        """Turned about the origin by rad counter-clockwise, and then moved."""
        rotation, place = _rotation(turn), np.array([x, y])
        starts, centres = self.starts @ rotation.T + place, self.centres @ rotation.T + place
        return Cut(starts, self.edges @ rotation.T, self.first, self.counts, centres, self.radii, self.solid)

    def distances(self, origins: Array, directions: Array, reach: float) -> Array:
        """How far (R,) it is from origins (R, 2) along unit vectors (R, 2) to the first segment; inf beyond reach."""
        segments = self._segments(np.flatnonzero(self._met(origins, directions, reach).any(axis=0)))
        if not len(segments):
            return np.full(len(origins), np.inf)
        (ox, oy), (ux, uy) = origins.T[:, :, None], directions.T[:, :, None]
        (ax, ay), (ex, ey) = self.starts[segments].T, self.edges[segments].T
        nearest: Array = _along((ax - ox, ay - oy), (ex, ey), (ux, uy), reach).min(axis=1)
        return nearest

    def scan(self, origin: Array, directions: Array, increment: float, reach: float) -> Array:
        """As ``distances`` (R,) from one origin (2,), 0 inside a solid body.

        Each unit vector is turned from the one before by the increment (rad), all of them by a full turn at most, so
        that each segment is tried with the rays alone that are within the angle at which it is seen.
        """
        if self.contains(origin[None])[0]:
            return np.zeros(len(directions))
        segments = self._segments(np.flatnonzero(np.hypot(*(self.centres - origin).T) - self.radii <= reach))
        (wx, wy), (ex, ey) = (self.starts[segments] - origin).T, self.edges[segments].T
        bx, by = wx + ex, wy + ey
        turn, towards = wx * ey - wy * ex, wx * bx + wy * by
        begin = np.where(turn >= 0.0, np.arctan2(wy, wx), np.arctan2(by, bx))
        first = np.mod(begin - math.atan2(directions[0, 1], directions[0, 0]), math.tau) / increment
        last = first + np.abs(np.arctan2(turn, towards)) / increment
        touched = (towards <= 0.0) & (np.abs(turn) <= _NEAR * (ex * ex + ey * ey))
        first[touched], last[touched] = 0.0, len(directions)
        around = math.tau / increment  # what goes on beyond the last ray may meet the first ones again
        low = np.maximum(np.ceil(np.concatenate([first, first - around]) - _NEAR), 0.0).astype(np.intp)
        high = np.floor(np.concatenate([last, last - around]) + _NEAR).astype(np.intp)
        counts = np.maximum(np.minimum(high, len(directions) - 1) - low + 1, 0)
        ray = np.arange(counts.sum()) + np.repeat(low - np.cumsum(counts) + counts, counts)
        tried = np.repeat(np.tile(np.arange(len(segments)), 2), counts)
        nearest, seen = np.full(len(directions), np.inf), (self.starts[segments[tried]] - origin).T
        np.minimum.at(nearest, ray, _along(seen, self.edges[segments[tried]].T, directions[ray].T, reach))
        return nearest

    def nearest(self, origins: Array, directions: Array, half: float, reach: float) -> Array:
        """How far (P,) it is from origins (P, 2) to what is within an angle (rad, up to pi/2) on both sides of them.

        Nothing hides the nearest point of a sector, so that no rays are needed.
        """
        (ox, oy), (ux, uy) = origins.T[:, :, None], directions.T[:, :, None]
        c, s = math.cos(half), math.sin(half)
        sides = [(s * ux + turn * c * uy, s * uy - turn * c * ux) for turn in (1.0, -1.0)]  # they point inwards
        (cx, cy), r = self.centres.T, self.radii
        wx, wy = cx - ox, cy - oy
        inside = np.logical_and.reduce([wx * nx + wy * ny >= -r for nx, ny in sides])
        segments = self._segments(np.flatnonzero((inside & (np.hypot(wx, wy) - r <= reach)).any(axis=0)))
        if not len(segments):
            return np.full(len(origins), np.inf)
        (ax, ay), (ex, ey) = self.starts[segments].T, self.edges[segments].T
        ax, ay = ax - ox, ay - oy
        first, last = np.zeros_like(ax), np.ones_like(ax)
        with np.errstate(divide="ignore", invalid="ignore"):
            for nx, ny in sides:
                from_side, along = ax * nx + ay * ny, ex * nx + ey * ny
                crossing = -from_side / along
                first = np.where(along > 0.0, np.maximum(first, crossing), first)
                last = np.where(along < 0.0, np.minimum(last, crossing), last)
                last = np.where((along == 0.0) & (from_side < 0.0), -1.0, last)
            share = np.minimum(np.maximum(-(ax * ex + ay * ey) / (ex * ex + ey * ey), first), last)
        found = np.where(first <= last, np.hypot(ax + share * ex, ay + share * ey), np.inf).min(axis=1)
        return np.where(found <= reach, found, np.inf)

    def contains(self, points: Array) -> npt.NDArray[np.bool_]:
        """Whether each point (P, 2) is inside a solid body."""
        off = points[:, None, :] - self.centres
        near = self.solid & ((off * off).sum(axis=2) <= self.radii * self.radii)
        return np.array([any(self._surrounds(body, point) for body in np.flatnonzero(row).tolist())
                         for row, point in zip(near, points, strict=True)], np.bool_)  # fmt: skip

    def _surrounds(self, body: int, point: Array) -> bool:
        """By the number of segments to the right of the point, even outside and odd inside."""
        segments = slice(self.first[body], self.first[body] + self.counts[body])
        (ax, ay), (ex, ey) = self.starts[segments].T, self.edges[segments].T
        x, y = point
        crossing = (ay > y) != (ay + ey > y)
        to_the_right = ax[crossing] + (y - ay[crossing]) / ey[crossing] * ex[crossing] > x
        return bool(np.count_nonzero(to_the_right) % 2)

    def _met(self, origins: Array, directions: Array, reach: float) -> npt.NDArray[np.bool_]:
        """Whether a ray may meet a body (R, B), as far as the circle around it says."""
        (ox, oy), (ux, uy), (cx, cy) = origins.T[:, :, None], directions.T[:, :, None], self.centres.T
        wx, wy = cx - ox, cy - oy
        along = wx * ux + wy * uy
        beside, ahead = np.abs(wx * uy - wy * ux) <= self.radii, along >= -self.radii
        return np.asarray(beside & ahead & (along <= self.radii + reach), np.bool_)

    def _segments(self, bodies: Numbers) -> Numbers:
        first, counts = self.first[bodies], self.counts[bodies]
        before = np.cumsum(counts) - counts
        numbers: Numbers = np.repeat(first - before, counts) + np.arange(counts.sum())
        return numbers


def _along(w: Iterable[Array], e: Iterable[Array], u: Iterable[Array], reach: float) -> Array:
    """How far it is along unit vectors u to segments e that begin at w; inf where they are not met within reach."""
    (wx, wy), (ex, ey), (ux, uy) = w, e, u
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 / (ux * ey - uy * ex)
        along, place = (wx * ey - wy * ex) * share, (wx * uy - wy * ux) * share
        hit = (place >= -_SLACK) & (place <= 1 + _SLACK) & (along >= 0.0) & (along <= reach)
    return np.where(hit, along, np.inf)


def _rotation(turn: float) -> Array:
    c, s = math.cos(turn), math.sin(turn)
    return np.array([[c, -s], [s, c]])


def slice_mesh(vertices: Array, triangles: Indices, height: float) -> Array:
    """The segments (n, 2, 2) in which a mesh meets the plane z = height; what ends at this height is not met."""
    above = vertices[triangles, 2] > height
    crossed = triangles[above.any(axis=1) & ~above.all(axis=1)]
    over = vertices[crossed, 2] > height
    odd = np.where(over.sum(axis=1) == 1, over.argmax(axis=1), over.argmin(axis=1))
    rows = np.arange(len(crossed))
    apex = crossed[rows, odd]
    ends = [_crossing(vertices, apex, crossed[rows, (odd + side) % 3], height) for side in (1, 2)]
    return np.stack(ends, axis=1)


def _crossing(vertices: Array, one: Indices, other: Indices, height: float) -> Array:
    """Where the edges between two vertices have a height: the same point for both triangles of an edge."""
    low = np.where(vertices[one, 2] < vertices[other, 2], one, other)
    high = np.where(low == one, other, one)
    a, b = vertices[low], vertices[high]
    share = ((height - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
    crossing: Array = a[:, :2] + share * (b[:, :2] - a[:, :2])
    return crossing


def _placed(segments: Array, instance: Instance) -> Array:
    x, y, _ = instance.position
    return np.asarray(segments @ _rotation(math.pi - instance.angle).T + np.array([x, y]), np.float64)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A model's shape, cut at heights above its own origin."""

    vertices: Array
    triangles: Indices
    solid: bool

    @classmethod
    def load(cls, file: Path) -> Self:
        """Raises InputError."""
        vertices, triangles = load_obj(file)
        return cls(vertices, triangles, is_closed(vertices, triangles))

    def at(self, height: float) -> Array:
        return slice_mesh(self.vertices, self.triangles, height)

    @lru_cache(maxsize=_HEIGHTS)  # noqa: B019 - meshes live as long as their service
    def cut(self, height: float) -> Cut:
        return Cut.of([(self.at(height), self.solid)])


class Outlines:
    """All that stands in a map, and what moves in it: models at the frames of sender stamps."""

    def __init__(
        self, path: Path, walls: Sequence[str] = (), own: int | None = None, not_walls: Sequence[str] = ()
    ) -> None:
        """``walls`` are obstacles whose lines stop rays, ``*`` for all but ``not_walls``.

        The model at the frame ``own`` is the vehicle itself, which its sensors do not see. Raises InputError.
        """
        self._map: MapFile = read_map(path)
        every = [name for name in read_obstacles(self._map.path) if name not in not_walls] if EVERY in walls else []
        names = [*every, *(name for name in walls if name != EVERY)]
        self._walls: list[Line] = picked_lines(path, names)
        files = dict.fromkeys(model.file for model in self._map.models)
        self._meshes = {file: Mesh.load(file) for file in files}
        self.moving: dict[int, Mesh] = dict(self._moving(own))

    def at(self, height: float) -> Cut:
        """What stands still, at a height above the world's origin."""
        return self._standing(round(height, 4))

    @lru_cache(maxsize=_HEIGHTS)  # noqa: B019 - as of meshes
    def _standing(self, height: float) -> Cut:
        return Cut.of([*self._models(height), *self._blocks(height), *self._lines()])

    def bodies_at(self, height: float, places: Mapping[int, Place]) -> Iterator[Cut]:
        """The models that move, at a height, those of them whose places are known."""
        for stamp, mesh in self.moving.items():
            if place := places.get(stamp):
                yield mesh.cut(height - place.z).moved(place.x, place.y, place.yaw + FRAME_TURN)

    def _moving(self, own: int | None) -> Iterator[tuple[int, Mesh]]:
        for model in self._map.models:
            for stamp in model.frames:
                if stamp != own:
                    yield stamp, self._meshes[model.file]

    def _models(self, height: float) -> Iterator[tuple[Array, bool]]:
        for model in self._map.models:
            yield from _copies(model, self._meshes[model.file], height)

    def _blocks(self, height: float) -> Iterator[tuple[Array, bool]]:
        for block in self._map.blocks:
            for instance in block.instances:
                if -block.dimension[2] / 2 <= height - instance.position[2] < block.dimension[2] / 2:
                    yield _placed(_rectangle(block), instance), True

    def _lines(self) -> Iterator[tuple[Array, bool]]:
        for line in self._walls:
            yield np.array([line]), False


def _copies(model: ModelEntry, mesh: Mesh, height: float) -> Iterator[tuple[Array, bool]]:
    cuts: Mapping[float, Array] = {z: mesh.at(height - z) for z in {i.position[2] for i in model.instances}}
    for instance in model.instances:
        yield _placed(cuts[instance.position[2]], instance), mesh.solid


def _rectangle(block: BlockEntry) -> Array:
    x, y = block.dimension[0] / 2, block.dimension[1] / 2
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
