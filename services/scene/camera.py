"""Where the camera on a vehicle is, how it moves, and how it maps the world to pixels: poses, pinhole, frustum.

Frames of reference: world (z up); body (x forward, y left, z up); camera (x right, y down, z forward).
Picture coordinates count pixels from the upper left corner and are whole at pixel *centres*: the
picture spans -0.5 to width - 0.5. A vehicle is where its frames say; motion is that of its last two
frames, so that a picture can show what passes while the shutter is open.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import cv2
import numpy as np
import numpy.typing as npt

from dodo_dsl.opendlv.attitude import rotation, rotation_of
from services.base import UnusableMessageError

Array = npt.NDArray[np.float64]

NEAR = 0.01
"""Nothing closer to the camera than this is drawn, in m along the optical axis."""


def quaternion_rotation(x: float, y: float, z: float, w: float) -> Array:
    """The rotation of a quaternion of any length; UnusableMessageError when it has none or is not finite."""
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if not math.isfinite(length) or length < 1e-6:
        raise UnusableMessageError(f"quaternion ({x}, {y}, {z}, {w}) is not a rotation")
    return np.array(rotation_of(x / length, y / length, z / length, w / length))


@dataclass(frozen=True, eq=False)
class CameraPose:
    """A body in its parent frame: ``position`` (3,) in m, ``rotation`` (3, 3) body to parent."""

    position: Array
    rotation: Array

    @classmethod
    def at(cls, x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Self:
        """From a position in m and right-handed angles in rad (a positive pitch looks down)."""
        return cls(np.array([x, y, z], dtype=np.float64), np.array(rotation(roll, pitch, yaw)))

    def carrying(self, mounted: "CameraPose") -> "CameraPose":
        """The pose, in this pose's parent frame, of something mounted on this body."""
        position = self.position + self.rotation @ mounted.position
        return CameraPose(position, self.rotation @ mounted.rotation)


class Pinhole:
    """An ideal camera of square pixels: u = f x/z + (width - 1)/2, v = f y/z + (height - 1)/2."""

    def __init__(self, width: int, height: int, fovy: float) -> None:
        """Size in pixels, vertical field of view in rad: f = height / 2 / tan(fovy / 2)."""
        if width < 1 or height < 1:
            raise ValueError(f"a picture of {width} x {height} pixels cannot be drawn")
        if not 0.0 < fovy < math.pi:
            raise ValueError(f"fovy must lie between 0 and 180 degrees, not {math.degrees(fovy):g}")
        self.width, self.height, self.fovy = width, height, fovy
        self.focal = height / 2 / math.tan(fovy / 2)
        self.centre = np.array([(width - 1) / 2, (height - 1) / 2])
        f = self.focal
        self.matrix = np.array([[f, 0.0, self.centre[0]], [0.0, f, self.centre[1]], [0.0, 0.0, 1.0]])
        sides = np.array([[f, 0.0, width / 2], [-f, 0.0, width / 2], [0.0, f, height / 2], [0.0, -f, height / 2]])
        self.sides = sides / np.linalg.norm(sides, axis=1, keepdims=True)
        """Unit normals, pointing inwards, of the four planes through the camera and the picture's edges."""
        self.planes = np.column_stack([np.array([0.0, 0.0, 1.0]), self.sides.T])
        self.offsets = np.array([-NEAR, 0.0, 0.0, 0.0, 0.0])
        """Of the frustum, near plane first: inside is where ``p @ planes + offsets >= 0``."""

    def project(self, points: Array) -> Array:
        """Picture coordinates (..., 2) of points (..., 3) in the camera frame, all with z > 0."""
        return np.asarray(points[..., :2] * (self.focal / points[..., 2:]) + self.centre, np.float64)

    def view(self, pose: CameraPose) -> "View":
        right, down, forward = -pose.rotation[:, 1], -pose.rotation[:, 2], pose.rotation[:, 0]
        return View(self, pose.position, np.stack([right, down, forward]))


@dataclass(frozen=True, eq=False)
class View:
    """A camera at a place: ``position`` (3,) in the world, ``axes`` (3, 3) world to camera frame."""

    camera: Pinhole
    position: Array
    axes: Array

    def to_camera(self, points: Array) -> Array:
        """Camera coordinates (..., 3) of world points (..., 3)."""
        return (points - self.position) @ self.axes.T

    def visible_part(self, polygon: Array) -> Array:
        """The part of a convex polygon (k, 3), in the camera frame, inside the frustum; may be empty."""
        distances = polygon @ self.camera.planes + self.camera.offsets
        inside = distances >= 0.0
        if not inside.any(axis=0).all():
            return polygon[:0]
        for side in np.flatnonzero(~inside.all(axis=0)):
            polygon = clip(polygon, self.camera.planes[:, side], self.camera.offsets[side])
        return polygon


def clip(polygon: Array, normal: Array, offset: float) -> Array:
    """The part of a convex polygon (k, d) where ``normal . p + offset >= 0`` (Sutherland and Hodgman)."""
    if not len(polygon):
        return polygon
    distances: list[float] = (polygon @ normal + offset).tolist()
    if min(distances) >= 0.0:
        return polygon
    if max(distances) < 0.0:
        return polygon[:0]
    kept: list[list[float]] = []
    last, was = polygon[-1].tolist(), distances[-1]
    for point, now in zip(polygon.tolist(), distances, strict=True):
        if (was >= 0.0) != (now >= 0.0):
            t = was / (was - now)
            kept.append([a + t * (b - a) for a, b in zip(last, point, strict=True)])
        if now >= 0.0:
            kept.append(point)
        last, was = point, now
    return np.array(kept)


LONGEST_GAP = 1.0
"""Frames farther apart than this, in s, say nothing of the motion."""
FASTEST = 50.0
"""A body that is faster, in m/s, was put elsewhere and did not move."""
TYPICAL_DEPTH = 0.3
"""The distance, in m, by which the blur's length in the picture is estimated."""
FINEST, APART = 3.0, 6.0
"""Pixels of blur that cannot be distinguished from none, and between two pictures at most."""
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


def motion_between(earlier: CameraPose, later: CameraPose, microseconds: int) -> CameraMotion:
    """The motion that led from one pose to another, at the other; none where the gap or the speed makes no sense."""
    seconds = microseconds / 1e6
    if not 0.0 < seconds <= LONGEST_GAP:
        return still(later)
    velocity = (later.position - earlier.position) / seconds
    if float(np.linalg.norm(velocity)) > FASTEST:
        return still(later)
    turn, _ = cv2.Rodrigues(later.rotation @ earlier.rotation.T)
    return CameraMotion(later, velocity, np.asarray(turn[:, 0] / seconds, np.float64))


FARTHEST = 1e6
"""Frames farther than this from the origin, in m, are refused."""


def body_pose(frame: Any) -> CameraPose:
    """The pose in an ``opendlv.sim.Frame``; raises UnusableMessageError."""
    position = np.array([frame.x, frame.y, frame.z], dtype=np.float64)
    if not (np.abs(position) <= FARTHEST).all():
        raise UnusableMessageError(f"position ({frame.x}, {frame.y}, {frame.z}) is not within {FARTHEST:.0f} m")
    return CameraPose(position, quaternion_rotation(frame.qx, frame.qy, frame.qz, frame.qw))


def mount(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> CameraPose:
    """The camera on the body: offset in m, angles in degrees; a positive pitch looks up, as in OpenDLV."""
    return CameraPose.at(x, y, z, math.radians(roll), -math.radians(pitch), math.radians(yaw))
