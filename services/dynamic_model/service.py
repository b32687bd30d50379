"""The vehicle on the bus: requests in, velocities of its body out."""

import math
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from dodo_dsl.opendlv.assets.car import KIWI, read_car
from services.base import Context, Flags, Handler, Output, Service, period_of
from services.dynamic_model.drives import (
    ACCELERATION,
    LEFT,
    RIGHT,
    SPEED,
    BicycleDrive,
    DifferentialDrive,
    Drive,
    SingleTrack,
    TwoWheels,
)
from services.dynamic_model.model import PEDAL, STEERING, BodyMotion, KiwiDrive, Vehicle

RESET = "reset"
_CAR_ACCELERATION = 3.5
"""m/s2, of a bicycle by default."""
_PEDAL = ("opendlv.proxy.PedalPositionRequest", "position")
_AXLE = ("opendlv.proxy.AxleAngularVelocityRequest", "axleAngularVelocity")
_STEERING = ("opendlv.proxy.GroundSteeringRequest", "groundSteering")
_SPEED = ("opendlv.proxy.GroundSpeedRequest", "groundSpeed")
_ACCELERATION = ("opendlv.proxy.GroundAccelerationRequest", "groundAcceleration")
_MOTION = "opendlv.proxy.GroundMotionRequest"
_YAW_RATE = "opendlv.proxy.AngularVelocityReading"


class DynamicModel(Service):
    """Takes requests and sends the body's velocities, under the sender stamp ``frame-id``."""

    def __init__(self, context: Context) -> None:
        self._log = context.log
        self._messages = context.messages
        flags = context.flags
        self.period = period_of(flags["freq"])
        self.vehicle = Vehicle(_drive(flags), flags["latency"])
        self.inputs = self._requests(flags)
        self.inputs |= {(_MOTION, None): self._follow, ("opendlv.sim.Command", None): self._command}
        self._moves_sideways = False
        self._state = context.messages.type("opendlv.sim.KinematicState")
        self._frame_id = flags["frame-id"]
        self._yaw_rate_id: int | None = flags["yaw-rate-id"] if flags["odometry"] else None

    def update(self, now: int) -> list[Output]:
        motion = self.vehicle.update(now)
        state = Output(self._state(vx=motion.vx, vy=motion.vy, yawRate=motion.yaw_rate), self._frame_id)
        return [state] if self._yaw_rate_id is None else [state, *self._odometry(motion.yaw_rate, self._yaw_rate_id)]

    def _odometry(self, yaw_rate: float, stamp: int) -> Iterator[Output]:
        for name, field, sender_stamp, value in self.vehicle.odometry:
            yield Output(self._messages.type(name)(**{field: value}), sender_stamp)
        yield Output(self._messages.type(_YAW_RATE)(angularVelocityZ=yaw_rate), stamp)

    def _requests(self, flags: Flags) -> dict[tuple[str, int | None], Handler]:
        """The requests that drive this vehicle, by message and sender stamp."""
        if flags["drive"] == "differential":
            name, field = _AXLE if flags["wheel-input"] == "axle" else _PEDAL
            return {(name, stamp): self._handler(name, field, wheel) for stamp, wheel in enumerate((LEFT, RIGHT))}
        driving, actuator = _PEDAL, PEDAL
        if flags["drive"] == "bicycle":
            by_speed = flags["speed-input"] == "speed"
            driving, actuator = (_SPEED, SPEED) if by_speed else (_ACCELERATION, ACCELERATION)
        both = ((_STEERING, STEERING), (driving, actuator))
        return {(name, None): self._handler(name, field, each) for (name, field), each in both}

    def _handler(self, name: str, field: str, actuator: str) -> Handler:
        def take(message: Any, _sample_time: int) -> None:
            value = getattr(message, field)
            if not self.vehicle.request(actuator, value):
                self._log.warning("ignored a %s of %s", name.rpartition(".")[2], value)

        return take

    def _follow(self, message: Any, _sample_time: int) -> None:
        motion = BodyMotion(message.vx, message.vy, message.yawRate)
        if not self.vehicle.follow(motion):
            self._log.warning("ignored a GroundMotionRequest of %s, %s, %s", motion.vx, motion.vy, motion.yaw_rate)
        elif motion.vy and not self._moves_sideways:
            self._moves_sideways = True
            self._log.warning("no drive moves sideways: vy of %g m/s, and of all others, has no effect", motion.vy)

    def _command(self, message: Any, _sample_time: int) -> None:
        if message.command == RESET:
            self.vehicle.reset()


def _drive(flags: Flags) -> Drive:
    """The drive of the flags; raises InputError, and ValueError for a car that cannot be."""
    grip, power, offset = flags["grip"], flags["power"], math.radians(flags["steering-offset"] or 0)
    friction = grip * (flags["friction"] or 0)
    if flags["drive"] == "differential":
        wheels = _of(
            TwoWheels,
            flags,
            friction=friction,
            max_yaw_rate=math.radians(flags["max-yaw-rate"]),
            max_acceleration=flags["max-acceleration"] or math.inf,
        )
        return DifferentialDrive(wheels, flags["wheel-input"] == "axle", power)
    if flags["drive"] == "bicycle":
        car = _of(
            SingleTrack,
            flags,
            friction=friction,
            max_steering=math.radians(flags["max-steering"]),
            steering_rate=math.radians(flags["steering-rate"]),
            max_acceleration=flags["max-acceleration"] or _CAR_ACCELERATION,
        )
        return BicycleDrive(car, flags["speed-input"] == "speed", power, offset)
    kiwi = read_car(Path(flags["vehicle"])) if flags["vehicle"] else KIWI
    kiwi = replace(
        kiwi,
        cornering_front=kiwi.cornering_front * grip,
        cornering_rear=kiwi.cornering_rear * grip,
        gain_forward=kiwi.gain_forward * power,
        gain_reverse=kiwi.gain_reverse * power,
    )
    return KiwiDrive(kiwi, offset)


def _of(car: type[Any], flags: Flags, **others: float) -> Any:
    """A car by the flags that are named as its parameters, and ``others`` of them."""
    named = {each.name: flags[each.name.replace("_", "-")] for each in fields(car) if each.name not in others}
    return car(**named, **others)


build = DynamicModel
