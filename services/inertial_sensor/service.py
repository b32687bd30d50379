"""The inertial sensor on the bus."""

import math
import random
from collections.abc import Iterator
from typing import Any

from dodo_dsl.opendlv.attitude import Matrix, Vector, rotation
from services.base import Context, Output, Service, UnusableMessageError, period_of
from services.inertial_sensor.model import BodyState, InertialModel, Origin, attitude, magnetic_field

_ANGULAR, _ACCELERATION = "opendlv.proxy.AngularVelocityReading", "opendlv.proxy.AccelerationReading"
_MAGNETIC, _PLACE = "opendlv.proxy.MagneticFieldReading", "opendlv.logic.sensation.Geolocation"


class InertialSensor(Service):
    """Takes frames and kinematic states of one sender, and sends its readings once it has both."""

    def __init__(self, context: Context) -> None:
        flags = context.flags
        self._flags = flags
        self._type = context.messages.type
        self.period = period_of(flags["freq"])
        mount = rotation(*(math.radians(flags[name]) for name in ("roll", "pitch", "yaw")))
        self._model = InertialModel((flags["x"], flags["y"], flags["z"]), mount, flags["gravity"])
        self._sent = [flags[name] for name in ("angular-velocity", "acceleration", "magnetic-field")]
        north = math.radians(flags["north"])
        self._origin = Origin(flags["latitude"], flags["longitude"], flags["altitude"], north)
        inclination, declination = (math.radians(flags[name]) for name in ("inclination", "declination"))
        self._field = magnetic_field(flags["field"], inclination, declination, north)
        self._pose: tuple[Matrix, Vector] | None = None
        self.inputs = {
            ("opendlv.sim.Frame", flags["frame-id"]): self._take_frame,
            ("opendlv.sim.KinematicState", flags["frame-id"]): self._take_state,
        }

    def update(self, now: int) -> list[Output]:
        if self._pose is None or not self._model.is_known:
            return []
        return [Output(message, self._flags["sender"]) for message in self._readings(*self._pose, now)]

    def _readings(self, body: Matrix, position: Vector, now: int) -> Iterator[Any]:
        """Those that are sent; the noise of each does not depend on the others."""
        flags, model = self._flags, self._model
        chance = random.Random(flags["seed"] << 64 | now)  # noqa: S311
        vectors = (
            (
                _ANGULAR,
                "angularVelocity",
                model.rates,
                math.radians(flags["gyro-bias"]),
                math.radians(flags["gyro-noise"]),
            ),
            (_ACCELERATION, "acceleration", model.force(body), flags["acceleration-bias"], flags["acceleration-noise"]),
            (_MAGNETIC, "magneticField", model.direction(body, self._field), flags["field-bias"], flags["field-noise"]),
        )
        for (name, field, value, bias, noise), is_sent in zip(vectors, self._sent, strict=True):
            measured = [each + bias + chance.gauss(0.0, noise) for each in value]
            if is_sent:
                yield self._type(name)(**{f"{field}{axis}": each for axis, each in zip("XYZ", measured, strict=True)})
        if flags["geolocation"]:
            yield self._place(body, position, chance)

    def _place(self, body: Matrix, position: Vector, chance: random.Random) -> Any:
        x, y, z = self._model.place(body, position)
        east, north, up = (chance.gauss(0.0, self._flags["position-noise"]) for _ in range(3))
        latitude, longitude, altitude = self._origin.geolocation((x, y, z + up), east, north)
        noise = chance.gauss(0.0, math.radians(self._flags["heading-noise"]))
        heading = self._origin.heading(math.atan2(body[1][0], body[0][0]) + noise)
        return self._type(_PLACE)(latitude=latitude, longitude=longitude, altitude=altitude, heading=heading)

    def _take_frame(self, frame: Any, _sample_time: int) -> None:
        body = attitude(frame.qx, frame.qy, frame.qz, frame.qw)
        if body is None or not math.isfinite(frame.x + frame.y + frame.z):
            raise UnusableMessageError("it has no position or no attitude")
        self._pose = body, (frame.x, frame.y, frame.z)

    def _take_state(self, state: Any, sample_time: int) -> None:
        velocity, rates = (state.vx, state.vy, state.vz), (state.rollRate, state.pitchRate, state.yawRate)
        if not all(map(math.isfinite, (*velocity, *rates))):
            raise UnusableMessageError("it is not finite")
        self._model.feed(BodyState(sample_time, velocity, rates))


build = InertialSensor
