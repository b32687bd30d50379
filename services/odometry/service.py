"""The odometry on the bus."""

import math
from typing import Any

from services.base import Context, Output, Service, UnusableMessageError, period_of
from services.odometry.model import Errors, Odometer, Twist


class Odometry(Service):
    """Takes kinematic states and sends the pose that they add up to, once it has heard one."""

    def __init__(self, context: Context) -> None:
        flags = context.flags
        self.period = period_of(flags["freq"])
        turns = (math.radians(flags[name]) for name in ("yaw-per-metre", "yaw-bias", "yaw-noise"))
        self._errors = Errors(flags["scale-error"], flags["speed-noise"], *turns)
        self._seed, self._stamp = flags["seed"] << 32 | flags["id"], flags["id"]
        self._type = context.messages.type("robot.OdometryReading")
        self._odometer = Odometer(self._errors, self._seed)
        self.inputs = {
            ("opendlv.sim.KinematicState", flags["frame-id"]): self._take_state,
            ("opendlv.sim.Command", None): self._command,
        }

    def update(self, now: int) -> list[Output]:
        self._odometer.update(now)
        pose, twist = self._odometer.pose, self._odometer.twist
        if pose is None:
            return []
        return [Output(self._type(**pose._asdict(), vx=twist.vx, vy=twist.vy, yawRate=twist.yaw_rate), self._stamp)]

    def _take_state(self, state: Any, sample_time: int) -> None:
        twist = Twist(state.vx, state.vy, state.yawRate)
        if not all(map(math.isfinite, twist)):
            raise UnusableMessageError(f"{twist} is not finite")
        self._odometer.feed(twist, sample_time)

    def _command(self, message: Any, _sample_time: int) -> None:
        if message.command == "reset":
            self._odometer = Odometer(self._errors, self._seed)


build = Odometry
