"""The lidar on the bus."""

import math
from pathlib import Path

from services.base import Context, Output, Service, period_of
from services.lidar.model import Lidar, Scanner
from services.scene.outlines import Outlines
from services.scene.places import Places


class LidarService(Service):
    """Sends a scan at its rate, once the vehicle's frame is known."""

    def __init__(self, context: Context, scanner: Scanner, places: Places) -> None:
        self.period, self.places, self.inputs = period_of(context.flags["freq"]), places, places.inputs
        self._scanner, self._type, self._stamp = scanner, context.messages.type("robot.PlanarScan"), context.flags["id"]
        lidar = scanner.lidar
        angles = {"angleMin": -lidar.field_of_view / 2, "angleIncrement": lidar.increment}
        self._facts = {**angles, "rangeMin": lidar.near, "rangeMax": lidar.far}

    def update(self, now: int) -> list[Output]:
        if (vehicle := self.places.vehicle) is None:
            return []
        ranges = self._scanner.ranges(vehicle, self.places.known).astype("<f4").tobytes()
        return [Output(self._type(**self._facts, ranges=ranges), self._stamp)]


def build(context: Context) -> LidarService:
    """The service from its flags; raises InputError and ValueError."""
    flags = context.flags
    near, far = flags["min-range"], flags["max-range"]
    if near >= far:
        raise ValueError(f"the range from {near:g} to {far:g} m is empty: --min-range has to be below --max-range")
    place = (flags["x"], flags["y"], flags["z"], math.radians(flags["yaw"]))
    lidar = Lidar(*place, math.radians(flags["field-of-view"]), flags["rays"], near, far, flags["noise"])
    outlines = Outlines(Path(flags["map-path"]), flags["walls"], flags["frame-id"], flags["not-walls"])
    scanner = Scanner(outlines, lidar, flags["seed"], flags["id"])
    return LidarService(context, scanner, Places(flags["frame-id"], outlines.moving))
