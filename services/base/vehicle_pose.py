"""Where a vehicle is in the plane, by its frame: apart from the rest of the base, as it loads what geometry needs."""

import math
from typing import Any

from dodo_dsl.opendlv.assets.track import VehiclePose
from dodo_dsl.opendlv.attitude import heading_of
from services.base.service import UnusableMessageError


def vehicle_pose(frame: Any) -> VehiclePose:
    """The pose in an ``opendlv.sim.Frame``; raises UnusableMessageError."""
    heading = heading_of(frame.qx, frame.qy, frame.qz, frame.qw)
    if heading is None or not math.isfinite(frame.x + frame.y):
        raise UnusableMessageError("it has no position or no attitude")
    return VehiclePose(frame.x, frame.y, heading)
