"""The attitude of bodies in ``opendlv.sim.Frame``, a quaternion from the body to the world."""

import math


def heading_of(qx: float, qy: float, qz: float, qw: float) -> float | None:
    """Heading in rad of an attitude quaternion of any length; None when it is zero or not finite."""
    length = math.hypot(qx, qy, qz, qw)
    if not math.isfinite(length) or length == 0.0:
        return None
    return math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
