"""From what passes before a camera to the picture that it gives: shutter, lens, overlays and sensor, in this order."""

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from services.scene.camera import CameraPose, Pinhole
from services.scene.draw.raster import Image
from services.scene.draw.render import Renderer
from services.scene.lens import Alignment, Distortion, lens_of
from services.scene.motion import CameraMotion
from services.virtual_camera.image.overlays import Overlay
from services.virtual_camera.image.sensor import Development, Sensor


class Optics:
    """Everything behind the scene that makes pictures of ``camera``; what is left out is ideal."""

    def __init__(
        self,
        camera: Pinhole,
        distortion: Distortion | None = None,
        sensor: Sensor | None = None,
        overlays: Sequence[Overlay] = (),
        shutter: float = 0.0,
        alignment: Alignment | None = None,
    ) -> None:
        """``shutter`` is open for so many seconds; ValueError for a lens that cannot be drawn."""
        self.camera = camera
        self.lens = lens_of(camera, distortion or Distortion(), alignment or Alignment())
        self.wide = self.lens.wide if self.lens else camera
        """What a renderer has to draw."""
        self._overlays, self._shutter = overlays, shutter
        self._development = Development(sensor or Sensor())
        shape = (self.wide.height, self.wide.width, 4)
        self._ideal = np.empty(shape, np.uint8)
        self._sums = np.empty((2, *shape), np.uint16) if shutter > 0.0 else None

    def expose(
        self, renderer: Renderer, motion: CameraMotion, mounted: CameraPose, sample_time: int, out: Image
    ) -> None:
        """The picture (height, width, 4) at ``sample_time`` us of a camera ``mounted`` on a body in ``motion``.

        The shutter is open half its time before that and half after it.
        """
        ideal = self._ideal if self.lens else out
        steps = motion.steps(self.wide, self._shutter)
        if self._sums is None or steps == 1:
            renderer.render(motion.pose.carrying(mounted), ideal)
        else:
            self._blend(renderer, motion, mounted, steps, self._sums, ideal)
        if self.lens:
            self.lens.apply(ideal, out)
        for overlay in self._overlays:
            overlay.lay(out)
        self._development.develop(out, sample_time)

    def _blend(
        self,
        renderer: Renderer,
        motion: CameraMotion,
        mounted: CameraPose,
        steps: int,
        sums: npt.NDArray[np.uint16],
        ideal: Image,
    ) -> None:
        """The mean of ``steps`` pictures while the shutter is open, that of the middle of it drawn whole."""
        poses = [motion.after(((step + 0.5) / steps - 0.5) * self._shutter).carrying(mounted) for step in range(steps)]
        middle = poses.pop(steps // 2)
        total, wide = sums
        total.fill(0)
        for picture in renderer.render_around(middle, poses, ideal):
            np.copyto(wide, picture)  # as to add numbers of two sizes takes longer
            cv2.add(total, wide, dst=total)
        cv2.convertScaleAbs(total, dst=ideal, alpha=1 / steps)
