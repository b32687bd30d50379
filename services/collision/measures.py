"""Measures taken while the vehicle drives, and the checks made of them."""

import math
from dataclasses import dataclass

from services.base import Check
from services.collision.geometry import VehiclePose

MICROSECONDS = 1_000_000


@dataclass
class DriveMeasures:
    """Distance driven (m), highest speed (m/s), smallest distance to a wall (m), time to the goal (s)."""

    distance: float = 0.0
    max_speed: float | None = None
    wall_margin: float | None = None
    time_to_goal: float | None = None

    def move(self, start: tuple[int, VehiclePose], end: tuple[int, VehiclePose]) -> float:
        """The vehicle went from one pose to the next, each with its time in microseconds; returns its speed."""
        length = math.hypot(end[1].x - start[1].x, end[1].y - start[1].y)
        speed = length * MICROSECONDS / (end[0] - start[0])
        self.distance += length
        self.max_speed = max(self.max_speed or 0.0, speed)
        return speed

    def approach(self, margin: float) -> None:
        """The vehicle came this close to a wall, in m; touching is a margin of zero."""
        self.wall_margin = margin if self.wall_margin is None else min(self.wall_margin, margin)

    def goal_check(self, max_time: float) -> Check:
        """The time to the goal; null, and not ok, when it was not reached."""
        is_reached = self.time_to_goal is not None
        return Check(
            "time-to-goal", self.time_to_goal, {"max": max_time}, "s", is_reached, parameters=("max-time", "goal")
        )

    @staticmethod
    def rest_check(rest: float) -> Check:
        """The way left to the goal in m; it says how far a drive that failed came, and decides nothing."""
        return Check("to-goal", rest, {"max": 0.0}, "m", rest <= 0.0, parameters=("goal", "gates"))

    def wall_check(self, limit: float) -> Check:
        """The margin, at least its limit, or more than a limit of zero: a wall touched is a wall hit."""
        margin = self.wall_margin
        is_kept = margin is not None and margin >= limit and margin > 0.0
        flags = ("min-margin", "walls")
        return Check("wall-margin", margin, {"min": limit}, "m", is_kept, exclusive=limit <= 0.0, parameters=flags)

    @staticmethod
    def gate_check(crossed: int, gates: int) -> Check:
        """The gates crossed in order; all of them are required."""
        return Check("gates", crossed, {"min": gates}, "", crossed == gates)

    def drive_checks(self, max_speed: float | None = None) -> tuple[Check, Check]:
        """The distance, and the speed with its limit in m/s, if there is one."""
        speed = {} if max_speed is None else {"max": max_speed}
        is_kept = max_speed is None or (self.max_speed is not None and self.max_speed <= max_speed)
        return Check("distance", self.distance, {}, "m", True), Check(
            "max-speed", self.max_speed, speed, "m/s", is_kept
        )
