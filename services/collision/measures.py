"""What is measured while the vehicle drives, and the checks made of it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import shapely

from services.base import Check
from services.collision.geometry import Pose

MICROSECONDS = 1_000_000


@dataclass
class Measures:
    """Distance driven (m), highest speed (m/s), smallest distance to a wall (m), time to the goal (s)."""

    distance: float = 0.0
    max_speed: float | None = None
    wall_margin: float | None = None
    time_to_goal: float | None = None

    def move(self, start: tuple[int, Pose], end: tuple[int, Pose]) -> None:
        """The vehicle went from one pose to the next, each with its time in microseconds."""
        length = math.hypot(end[1].x - start[1].x, end[1].y - start[1].y)
        self.distance += length
        self.max_speed = max(self.max_speed or 0.0, length * MICROSECONDS / (end[0] - start[0]))

    def approach(self, area: shapely.Geometry, walls: Iterable[shapely.Geometry]) -> None:
        """The vehicle covered an area beside the walls; touching is a margin of zero."""
        margins = [float(shapely.distance(wall, area)) for wall in walls]
        if self.wall_margin is not None:
            margins.append(self.wall_margin)
        self.wall_margin = min(margins, default=None)

    def goal_check(self, max_time: float) -> Check:
        """The time to the goal; null, and not ok, when it was not reached."""
        return Check("time-to-goal", self.time_to_goal, {"max": max_time}, "s", self.time_to_goal is not None)

    def wall_check(self) -> Check:
        """The margin, which has to be *above* its limit of zero: a wall touched is a wall hit."""
        margin = self.wall_margin
        return Check("wall-margin", margin, {"min": 0.0}, "m", margin is not None and margin > 0.0)

    def drive_checks(self) -> tuple[Check, Check]:
        """What has no limit."""
        return Check("distance", self.distance, {}, "m", True), Check("max-speed", self.max_speed, {}, "m/s", True)
