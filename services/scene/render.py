"""Pictures of a scene from anywhere, drawn with OpenCV and numpy.

What was drawn from one place is moved to where it is seen from another close to it. Models move as wholes, by the shift
and the scale of the middle of each. While a shutter is open that cannot be distinguished from a new drawing, and saves
culling, shading and sorting once more.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from services.scene.bodies import Bodies, Drawn
from services.scene.bsp import Tree
from services.scene.camera import NEAR, Array, CameraPose, Pinhole, View
from services.scene.raster import SHIFT, Colour, Fixed, Image, fill_fixed
from services.scene.scene import Scene
from services.scene.shading import Piece
from services.scene.surfaces import Face, FaceTable, cover_face, draw_backdrop

_ONE = 1 << SHIFT


class Movable:
    """Pieces of bodies as seen from one place, that can be seen from others."""

    def __init__(self, view: View, middles: Array, drawn: Sequence[tuple[int, list[Piece]]]) -> None:
        """``middles`` (n, 3) in the world, by the number of the body; ``drawn`` from back to front."""
        pieces = [piece for _, body in drawn for piece in body]
        corners = [len(points) for points, _ in pieces]
        self._ends = np.cumsum([0, *corners]).tolist()
        self._colours: list[Colour] = [colour for _, colour in pieces]
        self._points = np.concatenate([np.zeros((0, 2)), *(points.reshape(-1, 2) for points, _ in pieces)])
        self._counts = [len(body) for _, body in drawn]
        owners = np.repeat([body for body, _ in drawn], self._counts).astype(np.intp)
        self._owners = np.repeat(owners, np.array(corners, np.intp))
        self._middles = middles
        self._place = view.to_camera(middles)

    def seen_from(self, view: View) -> Iterator[list[Piece]]:
        """The pieces of each body, in the same order; a body whose middle is not before the camera stays."""
        place, before = view.to_camera(self._middles), self._place
        known = (place[:, 2] > NEAR) & (before[:, 2] > NEAR)
        size, shift = np.ones((len(place), 1)), np.zeros((len(place), 2))
        size[known] = before[known, 2:] / place[known, 2:]
        old, new = (view.camera.project(points[known]) for points in (before, place))
        shift[known] = (new - old * size[known]) * _ONE
        moved: Fixed = np.rint(self._points * size[self._owners] + shift[self._owners]).astype(np.int32)
        points = [moved[start:end] for start, end in zip(self._ends, self._ends[1:], strict=False)]
        pieces = iter(zip(points, self._colours, strict=True))
        for count in self._counts:
            yield [next(pieces) for _ in range(count)]


Labels = npt.NDArray[np.int32]


class Renderer:
    """Draws a scene; the same pose, and places of what moves, give the same bytes, whatever was drawn before."""

    def __init__(self, scene: Scene, width: int, height: int, fovy: float) -> None:
        """The picture's size in pixels, the vertical field of view in rad; ValueError if they make no sense."""
        self.camera = Pinhole(width, height, fovy)
        self.scene = scene
        self._tree = Tree(list(scene.faces))
        self._faces = FaceTable(self._tree.faces)
        self.bodies = Bodies(scene.models, self._tree, scene.light, scene.faces)
        self._latest: tuple[bytes, list[Face | Drawn]] = b"", []
        """What was drawn last, from back to front, and the pose that it was drawn from."""

    def place(self, stamp: int, pose: CameraPose) -> None:
        """A body moves: what the map has at the frames of a sender stands upright there, by the yaw of its ``pose``."""
        yaw = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        self.bodies.place(stamp, pose.position, yaw)
        self._latest = b"", []

    def render(self, pose: CameraPose, out: Image | None = None) -> Image:
        """What a camera sees: (height, width, 4) in the order B, G, R, A.

        ``pose`` is the camera in the world, looking along its x axis with z up. ``out`` takes the
        picture when given, which saves making a new one.
        """
        image = np.empty((self.camera.height, self.camera.width, 4), np.uint8) if out is None else out
        view = self.camera.view(pose)
        self._draw(image, view, self._back_to_front(view))
        return image

    def render_around(self, pose: CameraPose, others: Iterable[CameraPose], out: Image) -> Iterator[Image]:
        """What a camera sees from ``pose``, and from each of the others close to it; all in ``out``, one by one.

        From the others the models are moved as wholes, and stay in the order that they have from ``pose``.
        """
        yield self.render(pose, out)
        items = self._latest[1]
        drawn = [item for item in items if not isinstance(item, Face)]
        movable = Movable(self.camera.view(pose), self.bodies.middles, drawn)
        for other in others:
            view = self.camera.view(other)
            moved = movable.seen_from(view)
            self._draw(out, view, (item if isinstance(item, Face) else (item[0], next(moved)) for item in items))
            yield out

    def _draw(self, image: Image, view: View, items: Iterable[Face | Drawn]) -> None:
        items = list(items)
        shown = self._faces.shown(view, [item for item in items if isinstance(item, Face)])
        draw_backdrop(image, view, self.scene.sky, self.scene.ground)
        for item in items:
            if isinstance(item, Face):
                for patch in shown.get(item, ()):
                    patch.draw(image)
            else:
                for points, colour in item[1]:
                    fill_fixed(image, points, colour)

    def labels(self, pose: CameraPose) -> tuple[Labels, dict[int, list[Piece]]]:
        """For each pixel (height, width) the number of the body that it shows, or -1; and all that is drawn of each."""
        view = self.camera.view(pose)
        image = np.full((self.camera.height, self.camera.width), -1, np.int32)
        bodies: dict[int, list[Piece]] = {}
        items = self._back_to_front(view)
        shown = self._faces.shown(view, [item for item in items if isinstance(item, Face)])
        for item in items:
            if isinstance(item, Face):
                if item in shown:
                    cover_face(image, view, item, -1)
            else:
                bodies.setdefault(item[0], []).extend(item[1])
                for points, _ in item[1]:
                    fill_fixed(image, points, (item[0],))
        return image, bodies

    def _back_to_front(self, view: View) -> list[Face | Drawn]:
        """All that may be seen; true boxes are looked for where a picture was drawn, so that it is kept until then."""
        pose = view.position.tobytes() + view.axes.tobytes()
        if pose != self._latest[0]:
            regions = self.bodies.pieces(view)
            items: list[Face | Drawn] = []
            for item in self._tree.back_to_front(view.position):
                items.extend([item] if isinstance(item, Face) else regions.get(item, ()))
            self._latest = pose, items
        return self._latest[1]
