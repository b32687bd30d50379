"""The attitude of bodies in ``opendlv.sim.Frame``, a quaternion from the body to the world."""

import math

Quaternion = tuple[float, float, float, float]


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


def heading_of(qx: float, qy: float, qz: float, qw: float) -> float | None:
    """Heading in rad of an attitude quaternion of any length; None when it is zero or not finite."""
    length = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(length) or length == 0.0:
        return None
    return math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
