"""The single-track model on the bus."""

import math
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.assets.car import KIWI, read_car
from services.base import Context, Output, Service, period_of
from services.dynamic_model.model import Condition, Vehicle

RESET = "reset"


class DynamicModel(Service):
    """Takes requests of any sender and sends the body's velocities, under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        self._log = context.log
        flags = context.flags
        self.period = period_of(flags["freq"])
        car = read_car(Path(flags["vehicle"])) if flags["vehicle"] else KIWI
        condition = Condition(flags["grip"], flags["power"], math.radians(flags["steering-offset"]), flags["latency"])
        self.vehicle = Vehicle(flags["freq"], car, flags["steps"], condition)
        stable = self.vehicle.car.stable_above(flags["freq"] * flags["steps"])
        self._log.debug("the steps are stable above %.3f m/s; sideways the car moves above %g", stable, car.slip_speed)
        self.inputs = {
            ("opendlv.proxy.GroundSteeringRequest", None): self._steer,
            ("opendlv.proxy.PedalPositionRequest", None): self._press,
            ("opendlv.sim.Command", None): self._command,
        }
        self._state = context.messages.type("opendlv.sim.KinematicState")
        self._frame_id = flags["frame-id"]

    def update(self, now: int) -> tuple[Output]:
        motion = self.vehicle.update(now)
        return (Output(self._state(vx=motion.vx, vy=motion.vy, yawRate=motion.yaw_rate), self._frame_id),)

    def _steer(self, message: Any, _sample_time: int) -> None:
        if not self.vehicle.steer(message.groundSteering):
            self._ignored("GroundSteeringRequest", message.groundSteering)

    def _press(self, message: Any, _sample_time: int) -> None:
        if not self.vehicle.press(message.position):
            self._ignored("PedalPositionRequest", message.position)

    def _command(self, message: Any, _sample_time: int) -> None:
        if message.command == RESET:
            self.vehicle.reset()

    def _ignored(self, name: str, value: float) -> None:
        if self.vehicle.rejected == 1:
            self._log.warning("ignored a %s of %s, and will ignore all that are not finite", name, value)


def build(context: Context) -> Service:
    """The service from its flags."""
    return DynamicModel(context)
