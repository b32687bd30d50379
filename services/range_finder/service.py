"""The range finder on the bus."""

import math
from collections.abc import Iterator
from pathlib import Path

from services.base import Context, Flags, Output, Service, period_of
from services.range_finder.model import Curve, Device, RangeFinder, Sensor
from services.scene.outlines import Outlines
from services.scene.places import Places

DISTANCE, VOLTAGE = "opendlv.proxy.DistanceReading", "opendlv.proxy.VoltageReading"


class RangeFinderService(Service):
    """Sends a reading of each sensor at its rate, once the vehicle's frame is known."""

    def __init__(self, context: Context, model: RangeFinder, moving: tuple[int, ...]) -> None:
        flags = context.flags
        self.period = period_of(flags["freq"])
        self._model, self.places = model, Places(flags["frame-id"], moving)
        self._type, self._field = context.messages.type(flags["message"]), flags["message"].split(".")[-1]
        self._field = self._field.removesuffix("Reading").lower()
        self.inputs = self.places.inputs

    def update(self, now: int) -> Iterator[Output]:
        if (vehicle := self.places.vehicle) is None:
            return
        readings = self._model.readings(vehicle, self.places.known)
        for sensor, value in zip(self._model.sensors, readings, strict=True):
            if value is not None:
                yield Output(self._type(**{self._field: value}), sensor.stamp)


def build(context: Context) -> Service:
    """The service from its flags; raises InputError and ValueError."""
    flags = context.flags
    outlines = Outlines(Path(flags["map-path"]), flags["walls"], flags["frame-id"], flags["not-walls"])
    model = RangeFinder(outlines, sensors_of(flags), device_of(flags), flags["seed"])
    return RangeFinderService(context, model, tuple(outlines.moving))


def sensors_of(flags: Flags) -> list[Sensor]:
    """The sensors; raises ValueError for flags that do not fit together."""
    stamps = flags["id"]
    if len(set(stamps)) < len(stamps) or not stamps:
        raise ValueError("--id needs a different sender stamp for each sensor")
    columns = {name: flags[name] for name in ("x", "y", "z", "yaw")}
    for name, values in columns.items():
        if len(values) not in (1, len(stamps)):
            raise ValueError(f"--{name} has {len(values)} items, expected one, or {len(stamps)} as --id has")
        columns[name] = [float(value) for value in (values if len(values) > 1 else values * len(stamps))]
    poses = zip(columns["x"], columns["y"], columns["z"], map(math.radians, columns["yaw"]), strict=True)
    return [Sensor(stamp, *pose) for stamp, pose in zip(stamps, poses, strict=True)]


def device_of(flags: Flags) -> Device:
    """What the sensors have in common; raises ValueError for flags that do not fit together."""
    in_volts = flags["message"] == VOLTAGE
    infrared = flags["sensor"] == "infrared" or (in_volts and flags["sensor"] is None)
    if in_volts and not infrared:
        raise ValueError(f"--message={VOLTAGE} is of infrared sensors: an ultrasonic one measures a distance")
    curve = Curve.parse(flags["curve"]) if infrared else None
    default = (0.0, curve.distances[0], curve.distances[-1]) if curve else (55.0, 0.03, 6.0)
    written = (flags[name] for name in ("cone", "min-range", "max-range"))
    cone, near, far = (d if value is None else value for value, d in zip(written, default, strict=True))
    if near >= far:
        raise ValueError(f"the range from {near:g} to {far:g} m is empty: --min-range has to be below --max-range")
    errors = (flags["noise"], flags["outliers"])
    return Device(math.radians(cone), flags["rays"], near, far, flags["beyond"], curve, in_volts, *errors)
