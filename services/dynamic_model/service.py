"""The single-track model on the bus."""

from typing import Any

from services.base import Context, Output, Service, period_of
from services.dynamic_model.model import Vehicle


class DynamicModel(Service):
    """Takes requests of any sender and says how the body moves, under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        self._log = context.log
        self.period = period_of(context.flags["freq"])
        self.vehicle = Vehicle(context.flags["freq"])
        self.inputs = {
            ("opendlv.proxy.GroundSteeringRequest", None): self._steer,
            ("opendlv.proxy.PedalPositionRequest", None): self._press,
        }
        self._state = context.messages.type("opendlv.sim.KinematicState")
        self._frame_id = context.flags["frame-id"]

    def update(self, now: int) -> tuple[Output]:
        motion = self.vehicle.update(now)
        return (Output(self._state(vx=motion.vx, vy=motion.vy, yawRate=motion.yaw_rate), self._frame_id),)

    def _steer(self, message: Any, _sample_time: int) -> None:
        if not self.vehicle.steer(message.groundSteering):
            self._ignored("GroundSteeringRequest", message.groundSteering)

    def _press(self, message: Any, _sample_time: int) -> None:
        if not self.vehicle.press(message.position):
            self._ignored("PedalPositionRequest", message.position)

    def _ignored(self, name: str, value: float) -> None:
        if self.vehicle.rejected == 1:
            self._log.warning("a %s of %s is ignored, as all that are not finite will be", name, value)


def build(context: Context) -> Service:
    """The service from its flags."""
    return DynamicModel(context)
