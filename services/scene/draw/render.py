"""Pictures of a scene from anywhere, drawn with OpenCV and numpy."""

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from services.scene.camera import CameraPose, Pinhole, View
from services.scene.draw.bodies import Bodies, Drawn
from services.scene.draw.bsp import Tree
from services.scene.draw.faces import Face
from services.scene.draw.moved import Movable
from services.scene.draw.raster import Image, fill_fixed
from services.scene.draw.scene import Scene
from services.scene.draw.shading import Piece
from services.scene.draw.surfaces import cover_face, draw_backdrop, draw_face

Labels = npt.NDArray[np.int32]


class Renderer:
    """Draws a scene; the same pose gives the same bytes, whatever was drawn before."""

    def __init__(self, scene: Scene, width: int, height: int, fovy: float) -> None:
        """The picture's size in pixels, the vertical field of view in rad; ValueError where they make no sense."""
        self.camera = Pinhole(width, height, fovy)
        self.scene = scene
        self._tree = Tree(list(scene.faces))
        self.bodies = Bodies(scene.models, self._tree, scene.light, scene.faces)
        self._latest: tuple[bytes, list[Face | Drawn]] = b"", []
        """What was drawn last, from back to front, and the pose that it was drawn from."""

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
        draw_backdrop(image, view, self.scene.sky, self.scene.ground)
        for item in items:
            if isinstance(item, Face):
                draw_face(image, view, item)
            else:
                for points, colour in item[1]:
                    fill_fixed(image, points, colour)

    def labels(self, pose: CameraPose) -> tuple[Labels, dict[int, list[Piece]]]:
        """For each pixel (height, width) the number of the body that it shows, or -1; and all that is drawn of each."""
        view = self.camera.view(pose)
        image = np.full((self.camera.height, self.camera.width), -1, np.int32)
        bodies: dict[int, list[Piece]] = {}
        for item in self._back_to_front(view):
            if isinstance(item, Face):
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
