"""Pictures of a scene from anywhere, drawn with OpenCV and numpy."""

import numpy as np

from services.virtual_camera.bodies import Bodies
from services.virtual_camera.bsp import Tree
from services.virtual_camera.camera import Pinhole, Pose
from services.virtual_camera.faces import Face
from services.virtual_camera.raster import Image, fill_fixed
from services.virtual_camera.scene import Scene
from services.virtual_camera.surfaces import draw_backdrop, draw_face


class Renderer:
    """Draws a scene; the same pose gives the same bytes, whatever was drawn before."""

    def __init__(self, scene: Scene, width: int, height: int, fovy: float) -> None:
        """The picture's size in pixels, the vertical field of view in rad; ValueError where they make no sense."""
        self.camera = Pinhole(width, height, fovy)
        self._scene = scene
        self._tree = Tree(list(scene.faces))
        self._bodies = Bodies(scene.crowds, self._tree)

    def render(self, pose: Pose, out: Image | None = None) -> Image:
        """What a camera sees: (height, width, 4) in the order B, G, R, A.

        ``pose`` is the camera in the world, looking along its x axis with z up. ``out`` takes the
        picture when given, which saves making a new one.
        """
        image = np.empty((self.camera.height, self.camera.width, 4), np.uint8) if out is None else out
        view = self.camera.view(pose)
        draw_backdrop(image, view, self._scene.sky, self._scene.ground)
        regions = self._bodies.pieces(view)
        for item in self._tree.back_to_front(view.position):
            if isinstance(item, Face):
                draw_face(image, view, item)
            else:
                for points, colour in regions.get(item, ()):
                    fill_fixed(image, points, colour)
        return image
