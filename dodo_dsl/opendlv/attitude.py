"""The attitude of bodies in ``opendlv.sim.Frame``, a quaternion from the body to the world."""

import math
from typing import Any

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
"""Three rows."""


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Attitude from angles in rad: yaw about z, then pitch about the new y, then roll about the new x."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rotation(roll: float, pitch: float, yaw: float) -> Matrix:
    """The matrix of angles in rad, as ``quaternion`` turns by them, from the body to its parent."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rotation_of(x: Any, y: Any, z: Any, w: Any) -> Any:
    """The matrix of a quaternion of length one, from the body to the world; of arrays, one of arrays."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def heading_of(qx: float, qy: float, qz: float, qw: float) -> float | None:
    """Heading in rad of an attitude quaternion of any length; None when it is zero or not finite."""
    length = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(length) or length == 0.0:
        return None
    return math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
