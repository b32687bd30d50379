"""A binary space partition: which faces and which places come first, seen from anywhere.

Fuchs, Kedem and Naylor 1980. Each node divides space by the plane of a face; faces that cross it are
cut in two, so that drawing from back to front is right even if boxes touch or intersect.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import compress

import numpy as np
import numpy.typing as npt

from services.scene.camera import Array, clip
from services.scene.surfaces import Face

_THICK = 1e-6


@dataclass(eq=False)
class _Node:
    normal: Array
    offset: float
    number: int
    faces: list[Face]
    children: "list[_Node | int]" = field(default_factory=lambda: [-1, -1])
    """What lies behind the plane and what lies before it: a node, or the number of a leaf."""


def _area(face: Face) -> float:
    points = face.points
    fan = np.cross(points[1:-1] - points[0], points[2:] - points[0])
    return float(np.linalg.norm(fan.sum(axis=0))) / 2


def _divide(face: Face, node: _Node, sides: tuple[list[Face], list[Face]]) -> None:
    distance = face.points @ node.normal - node.offset
    if (np.abs(distance) <= _THICK).all():
        node.faces.append(face)
    elif (distance <= _THICK).all():
        sides[0].append(face)
    elif (distance >= -_THICK).all():
        sides[1].append(face)
    else:
        sides[0].append(face.part(clip(face.points, -node.normal, node.offset)))
        sides[1].append(face.part(clip(face.points, node.normal, -node.offset)))


_MANY = 64
_TRIED = 32
"""Faces of which the one that cuts the fewest is taken."""


def _first(_faces: list[Face]) -> int:
    return 0


def _largest(faces: list[Face]) -> int:
    return max(range(len(faces)), key=lambda number: _area(faces[number]))


def _gentlest(faces: list[Face]) -> int:
    """The number of the face whose plane cuts the fewest others, as far as some of all sizes are tried."""
    by_size = sorted(range(len(faces)), key=lambda number: -_area(faces[number]))
    tried = by_size[:: max(1, len(faces) // _TRIED)]
    starts = np.cumsum([0, *(len(face.points) for face in faces[:-1])])
    normals = np.array([faces[number].normal for number in tried])
    heights = np.concatenate([face.points for face in faces]) @ normals.T - [faces[number].offset for number in tried]
    low, high = (each.reduceat(heights, starts, axis=0) for each in (np.minimum, np.maximum))
    return tried[int(((low < -_THICK) & (high > _THICK)).sum(axis=0).argmin())]


def _planes(those: Sequence[_Node | Face]) -> tuple[Array, Array]:
    normals = np.array([each.normal for each in those]).reshape(-1, 3)
    return normals, np.array([each.offset for each in those])


def _heights(planes: tuple[Array, Array], eye: Array) -> Array:
    """How high a point (3,) is above each of the planes."""
    normals, offsets = planes
    return np.asarray(normals @ eye - offsets, np.float64)


class Tree:
    """The partition of some faces; ``leaves`` counts the convex regions that they leave.

    Large faces divide space first, or those that come first in the list; of many faces those that cut the fewest.
    """

    def __init__(self, faces: list[Face], by_area: bool = True) -> None:
        self.leaves = 0
        self._first = _first if not by_area else _largest if len(faces) < _MANY else _gentlest
        self._nodes: list[_Node] = []
        self._root: _Node | int = -1
        tasks: list[tuple[list[Face], _Node | None, int]] = [(faces, None, 0)]
        while tasks:
            todo, parent, side = tasks.pop()
            child = self._grow(todo, tasks)
            if parent is None:
                self._root = child
            else:
                parent.children[side] = child
        self.faces = [face for node in self._nodes for face in node.faces]
        """All faces, cut as the partition cuts them."""
        self._planes = _planes(self._nodes)
        self._facing = _planes(self.faces)

    def _grow(self, faces: list[Face], tasks: list[tuple[list[Face], _Node | None, int]]) -> _Node | int:
        if not faces:
            self.leaves += 1
            return self.leaves - 1
        first = self._first(faces)
        node = _Node(faces[first].normal, faces[first].offset, len(self._nodes), [faces[first]])
        self._nodes.append(node)
        sides: tuple[list[Face], list[Face]] = ([], [])
        for face in faces[:first] + faces[first + 1 :]:
            _divide(face, node, sides)
        tasks += [(sides[0], node, 0), (sides[1], node, 1)]
        return node

    def locate(self, points: Array) -> npt.NDArray[np.intp]:
        """The leaf (n,) that each point (n, 3) lies in."""
        leaf = np.zeros(len(points), np.intp)
        tasks = [(self._root, np.arange(len(points)))]
        while tasks:
            node, members = tasks.pop()
            if isinstance(node, int):
                leaf[members] = node
                continue
            before = points[members] @ node.normal > node.offset
            tasks += [(node.children[0], members[~before]), (node.children[1], members[before])]
        return leaf

    def distribute(self, faces: list[Face]) -> dict[int, list[Face]]:
        """Other faces by the leaf that they lie in, cut where they cross a plane of the partition."""
        found: dict[int, list[Face]] = {}
        tasks = [(self._root, faces)]
        while tasks:
            node, parts = tasks.pop()
            if isinstance(node, int):
                found[node] = parts
                continue
            sides: tuple[list[Face], list[Face]] = ([], [])
            for face in parts:
                if (np.abs(face.points @ node.normal - node.offset) <= _THICK).all():
                    sides[int(float(face.normal @ node.normal) > 0.0)].append(face)
                else:
                    _divide(face, node, sides)
            tasks += [(child, side) for child, side in zip(node.children, sides, strict=True) if side]
        return found

    def back_to_front(self, eye: Array) -> Iterator[Face | int]:
        """Faces that show their front to the eye (3,), and leaves, the farthest first."""
        is_before = _heights(self._planes, eye) > 0
        is_shown = _heights(self._facing, eye) > _THICK
        before, shown = is_before.tolist(), set(compress(self.faces, is_shown.tolist()))
        tasks: list[_Node | int | Face] = [self._root]
        while tasks:
            item = tasks.pop()
            if not isinstance(item, _Node):
                yield item
                continue
            near = before[item.number]
            tasks.append(item.children[near])
            tasks += [face for face in item.faces if face in shown]
            tasks.append(item.children[1 - near])
