"""The integrator on the bus."""

import math
from typing import Any

from services.base import Context, Flags, Output, Service, period_of
from services.integrator.model import Integrator, Pose, Twist
from services.integrator.rotation import quaternion


class Integration(Service):
    """Takes kinematic states and says where the body is, both under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        self._log = context.log
        self.period = period_of(context.flags["freq"])
        self.body = Integrator(start(context.flags))
        self.rejected = 0
        self._frame = context.messages.type("opendlv.sim.Frame")
        self._frame_id = context.flags["frame-id"]
        self.inputs = {("opendlv.sim.KinematicState", self._frame_id): self._feed}

    def update(self, now: int) -> tuple[Output]:
        pose = self.body.update(now)
        x, y, z = pose.position
        qx, qy, qz, qw = pose.attitude
        return (Output(self._frame(x=x, y=y, z=z, qx=qx, qy=qy, qz=qz, qw=qw), self._frame_id),)

    def _feed(self, state: Any, sample_time: int) -> None:
        twist = Twist((state.vx, state.vy, state.vz), (state.rollRate, state.pitchRate, state.yawRate))
        if all(map(math.isfinite, (*twist.velocity, *twist.rates))):
            self.body.feed(twist, sample_time)
            return
        self.rejected += 1
        if self.rejected == 1:
            self._log.warning("a KinematicState of %s is ignored, as all that are not finite will be", twist)


def start(flags: Flags) -> Pose:
    """Where the body stands at first: metres and degrees on the flags."""
    angles = (math.radians(flags[name]) for name in ("roll", "pitch", "yaw"))
    return Pose((float(flags["x"]), float(flags["y"]), float(flags["z"])), quaternion(*angles))


def build(context: Context) -> Service:
    """The service from its flags."""
    return Integration(context)
