"""A binary space partition: which faces and which places come first, seen from anywhere.

Fuchs, Kedem and Naylor 1980. Each node divides space by the plane of a face; faces that cross it are
cut in two, so that drawing from back to front is right even where boxes touch or intersect.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from services.scene.camera import Array, clip
from services.scene.surfaces import Face

_THICK = 1e-6


@dataclass(eq=False)
class _Node:
    normal: Array
    offset: float
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


class Tree:
    """The partition of some faces; ``leaves`` counts the convex regions that they leave.

    Large faces divide space first, or those that come first in the list.
    """

    def __init__(self, faces: list[Face], by_area: bool = True) -> None:
        self.leaves = 0
        self._by_area = by_area
        self._root: _Node | int = -1
        tasks: list[tuple[list[Face], _Node | None, int]] = [(faces, None, 0)]
        while tasks:
            todo, parent, side = tasks.pop()
            child = self._grow(todo, tasks)
            if parent is None:
                self._root = child
            else:
                parent.children[side] = child

    def _grow(self, faces: list[Face], tasks: list[tuple[list[Face], _Node | None, int]]) -> _Node | int:
        if not faces:
            self.leaves += 1
            return self.leaves - 1
        first = max(range(len(faces)), key=lambda i: _area(faces[i])) if self._by_area else 0
        node = _Node(faces[first].normal, faces[first].offset, [faces[first]])
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
        tasks: list[_Node | int | Face] = [self._root]
        while tasks:
            item = tasks.pop()
            if not isinstance(item, _Node):
                yield item
                continue
            height = float(item.normal @ eye) - item.offset
            near = int(height > 0)
            facing = [f for f in item.faces if float(f.normal @ eye) > f.offset + _THICK]
            tasks += [item.children[near], *facing, item.children[1 - near]]
