"""The virtual camera: follows a vehicle's frames and draws a picture whenever one is due."""

from collections import deque
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from services.scene.camera import LONGEST_GAP, CameraMotion, CameraPose, body_pose, motion_between, still
from services.scene.raster import Image
from services.scene.render import Renderer
from services.virtual_camera.optics import Optics

Publish = Callable[[Image, Image, int], None]
"""Takes a picture as ARGB (height, width, 4) and as I420 (height * 3 / 2, width), and its sample time in us.

Both arrays are drawn over by the next picture.
"""


def to_i420(argb: Image, out: Image | None = None) -> Image:
    """B, G, R, A (height, width, 4) as planes Y, U, V (height * 3 / 2, width), BT.601, Y from 16 to 235."""
    return np.asarray(cv2.cvtColor(argb, cv2.COLOR_BGRA2YUV_I420, dst=out), np.uint8)


class VirtualCamera:
    """Draws from the latest frame; before the first one from where the vehicle starts, if that is known."""

    def __init__(
        self,
        renderer: Renderer,
        mounted: CameraPose,
        publish: Publish,
        optics: Optics | None = None,
        start: CameraPose | None = None,
    ) -> None:
        """``mounted`` is the camera in the body frame, ``start`` the body before any frame.

        The renderer draws what ``optics`` need.
        """
        self._optics = optics or Optics(renderer.camera)
        width, height = self._optics.camera.width, self._optics.camera.height
        self._renderer, self._mounted, self._publish = renderer, mounted, publish
        self._argb = np.empty((height, width, 4), np.uint8)
        self._i420 = np.empty((height * 3 // 2, width), np.uint8)
        self._start = still(start) if start else None
        self._frames: deque[tuple[CameraPose, int]] = deque(maxlen=2)
        """The poses of the last frames, and their sample times."""

    def take_frame(self, frame: Any, sample_time: int) -> None:
        """The vehicle is where the frame says; ``sample_time`` in us of test time."""
        self._frames.append((body_pose(frame), sample_time))

    @property
    def bodies(self) -> tuple[int, ...]:
        """The sender stamps of all other bodies that move."""
        return self._renderer.bodies.stamps

    def take_body(self, stamp: int, frame: Any, sample_time: int) -> None:
        """Another body, of these frames, is where this one says; what moves stands still while the shutter is open."""
        self._renderer.place(stamp, body_pose(frame))

    def update(self, now: int) -> CameraPose | None:
        """Draws and publishes one picture, sampled at ``now`` (us of test time); the camera's pose in the world."""
        motion = self._motion(now)
        if motion is None:
            return None
        self._optics.expose(self._renderer, motion, self._mounted, now, self._argb)
        to_i420(self._argb, self._i420)
        self._publish(self._argb, self._i420, now)
        return motion.pose.carrying(self._mounted)

    def _motion(self, now: int) -> CameraMotion | None:
        if not self._frames:
            return self._start
        (before, earlier), (pose, framed) = self._frames[0], self._frames[-1]
        if now - framed > LONGEST_GAP * 1e6:
            return still(pose)
        return motion_between(before, pose, framed - earlier)  # which is none between a frame and itself
