"""How a body moves, from its last two frames, so that a picture can show what passes while the shutter is open."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from services.scene.camera import Array, CameraPose, Pinhole

LONGEST_GAP = 1.0
"""Frames farther apart than this, in s, say nothing of the motion."""
FASTEST = 50.0
"""A body that is faster, in m/s, was put elsewhere and did not move."""
TYPICAL_DEPTH = 0.3
"""The distance, in m, by which the blur's length in the picture is estimated."""
FINEST, APART = 3.0, 6.0
"""Pixels of blur that cannot be told from none, and between two pictures at most."""
MOST = 7


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """A pose that moves evenly: ``velocity`` (3,) in m/s, ``spin`` (3,) in rad/s about the world's axes."""

    pose: CameraPose
    velocity: Array
    spin: Array

    def after(self, seconds: float) -> CameraPose:
        """Where the body is so much later (or earlier, when negative)."""
        if not (self.velocity.any() or self.spin.any()):
            return self.pose
        turn, _ = cv2.Rodrigues(self.spin * seconds)
        return CameraPose(self.pose.position + self.velocity * seconds, turn @ self.pose.rotation)

    def steps(self, camera: Pinhole, shutter: float) -> int:
        """How many pictures the blur of ``shutter`` seconds takes: an odd number, one of the middle of it."""
        across = float(np.linalg.norm(self.velocity)) / TYPICAL_DEPTH + float(np.linalg.norm(self.spin))
        more = math.ceil((across * camera.focal * shutter - FINEST) / (2 * APART))
        return min(MOST, 1 + 2 * max(more, 0))


def still(pose: CameraPose) -> CameraMotion:
    return CameraMotion(pose, np.zeros(3), np.zeros(3))


def between(earlier: CameraPose, later: CameraPose, microseconds: int) -> CameraMotion:
    """The motion that led from one pose to another, at the other; none where the gap or the speed makes no sense."""
    seconds = microseconds / 1e6
    if not 0.0 < seconds <= LONGEST_GAP:
        return still(later)
    velocity = (later.position - earlier.position) / seconds
    if float(np.linalg.norm(velocity)) > FASTEST:
        return still(later)
    turn, _ = cv2.Rodrigues(later.rotation @ earlier.rotation.T)
    return CameraMotion(later, velocity, np.asarray(turn[:, 0] / seconds, np.float64))
