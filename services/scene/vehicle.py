"""Where a vehicle is, as its frames say, and the camera on it."""

import math
from typing import Protocol

import numpy as np

from services.scene.camera import CameraPose, quaternion_rotation

FARTHEST = 1e6
"""Frames farther than this from the origin, in m, are refused."""


class CameraFrame(Protocol):
    """The fields of ``opendlv.sim.Frame``: position in m and attitude of a body in the world."""

    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


def body_pose(frame: CameraFrame) -> CameraPose:
    """The pose in a frame; ValueError when it has none."""
    position = np.array([frame.x, frame.y, frame.z], dtype=np.float64)
    if not (np.abs(position) <= FARTHEST).all():
        raise ValueError(f"position ({frame.x}, {frame.y}, {frame.z}) is not within {FARTHEST:.0f} m")
    return CameraPose(position, quaternion_rotation(frame.qx, frame.qy, frame.qz, frame.qw))


def mount(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> CameraPose:
    """The camera on the body: offset in m, angles in degrees; a positive pitch looks up, as in OpenDLV."""
    return CameraPose.at(x, y, z, math.radians(roll), -math.radians(pitch), math.radians(yaw))
