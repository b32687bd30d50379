"""An application that drives along a corridor by a lidar and a Twist, of which it answers each scan with one."""

import math
import sys
from typing import Any

import numpy as np

from dodo_dsl.opendlv import Session

SPEED, GAIN, SIDE = 0.6, 4.0, math.radians(55)  # m/s, rad/s per m, where it looks


def beside(scan: Any, angle: float) -> float:
    """The distance in a direction, in m."""
    at = round((angle - scan.angleMin) / scan.angleIncrement)
    return float(np.clip(np.frombuffer(scan.ranges, "<f4")[at - 5 : at + 6], 0.0, 2.0).mean())


with Session(int(sys.argv[1].removeprefix("--cid="))) as session:
    motion, scans = session.messages.type("opendlv.proxy.GroundMotionRequest"), session.messages.id("robot.PlanarScan")
    session.hear_only([scans])
    while True:
        if envelope := session.receive(None):
            scan = session.messages.decode(scans, envelope.payload)
            turn = GAIN * (beside(scan, SIDE) - beside(scan, -SIDE))
            session.send(motion(vx=SPEED, yawRate=turn), envelope.sample_time)
