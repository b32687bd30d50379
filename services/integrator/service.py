"""The integrator on the bus."""

import math
from collections.abc import Iterator
from typing import Any

from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.attitude import quaternion
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags, Output, Service, UnusableMessageError, period_of
from services.integrator.model import BodyPose, Integrator, Twist, angles

FRAME, RESET = "opendlv.sim.Frame", "reset"
OLD_FRAME = odvd.STANDARD_0_9


class Integration(Service):
    """Takes kinematic states and sends the body's position, both under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        flags = context.flags
        self.period = period_of(flags["freq"])
        self.body = Integrator(start(flags))
        self._frame = context.messages.type(FRAME)
        self._old = MessageSet(odvd.load(OLD_FRAME)) if flags["euler"] else None
        self._stamps = [stamp for stamp in (flags["frame-id"], flags["copy-id"]) if stamp is not None]
        self.inputs = {
            ("opendlv.sim.KinematicState", flags["frame-id"]): self._take_state,
            ("opendlv.sim.Command", None): self._command,
        }

    def update(self, now: int) -> Iterator[Output | Envelope]:
        pose = self.body.update(now)
        x, y, z = pose.position
        qx, qy, qz, qw = pose.attitude
        frame = self._frame(x=x, y=y, z=z, qx=qx, qy=qy, qz=qz, qw=qw)
        for stamp in self._stamps:
            yield Output(frame, stamp)
            if self._old is not None:
                yield Envelope(self._old.id(FRAME), _old_payload(self._old, pose), now, 0, now, stamp)

    def _command(self, message: Any, _sample_time: int) -> None:
        if message.command == RESET:
            self.body.reset()

    def _take_state(self, state: Any, sample_time: int) -> None:
        twist = Twist((state.vx, state.vy, state.vz), (state.rollRate, state.pitchRate, state.yawRate))
        if not all(map(math.isfinite, (*twist.velocity, *twist.rates))):
            raise UnusableMessageError(f"{twist} is not finite")
        self.body.feed(twist, sample_time)


def _old_payload(messages: MessageSet, pose: BodyPose) -> bytes:
    (x, y, z), (roll, pitch, yaw) = pose.position, angles(pose.attitude)
    return messages.encode(messages.type(FRAME)(x=x, y=y, z=z, roll=roll, pitch=pitch, yaw=yaw))


def start(flags: Flags) -> BodyPose:
    """Where the body stands at first: metres and degrees on the flags."""
    angles = (math.radians(flags[name]) for name in ("roll", "pitch", "yaw"))
    return BodyPose((float(flags["x"]), float(flags["y"]), float(flags["z"])), quaternion(*angles))


build = Integration
