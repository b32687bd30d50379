"""The judge of a closed loop: the goal is to be reached in time, and no wall touched on the way."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import shapely

from services.base import Verdict
from services.collision.geometry import Box, Pose, outline, swept
from services.collision.measures import Measures

MICROSECONDS = 1_000_000
REQUESTS = ("GroundSteeringRequest", "PedalPositionRequest")


class UnjudgeableError(Exception):
    """There is nothing to judge the application by: the test itself is at fault."""


@dataclass(frozen=True)
class Track:
    """What may not be touched and what is to be reached: obstacles by name (m), and the time for it (s)."""

    walls: Mapping[str, shapely.MultiLineString]
    goal: Mapping[str, shapely.MultiLineString]
    max_time: float


class Judge:
    """Looks at the vehicle's poses in test time (microseconds) until `verdict` is there.

    Time zero is the first of `begin` and the application's first request; while there is neither, the first
    update. Poses from before time zero say where the vehicle starts and are not judged.
    """

    def __init__(self, track: Track, box: Box) -> None:
        self.verdict: Verdict | None = None
        self.track = track
        self.box = box
        self._measures = Measures()
        self._heard: set[str] = set()
        self._begun = False
        self._zero: int | None = None
        self._now: int | None = None
        self._last: tuple[int, Pose] | None = None

    def begin(self, now: int) -> None:
        """The test begins; only the first call counts, and what was measured before it is forgotten."""
        if not self._begun:
            self._begun, self._zero, self._measures = True, now, Measures()

    def request(self, name: str) -> None:
        """The application sent one of REQUESTS; it dates from the last update, not by its own clock."""
        self._heard.add(name)
        if self._now is not None:
            self.begin(self._now)

    def update(self, now: int) -> None:
        """Look at the time. Raises UnjudgeableError when it is over and no pose was ever seen."""
        self._now = now
        if self._heard:
            self.begin(now)
        if self.verdict is None and self._elapsed(now) > self.track.max_time:
            self._out_of_time()

    def end(self, now: int) -> None:
        """Nothing more will come: give the verdict now. Raises UnjudgeableError when no pose was seen."""
        if self.verdict is None:
            over = f"the input ended after {self._elapsed(now):.2f} s"
            self._give_up(f"before {over}", f"until {over}")

    def look(self, pose: Pose, time: int) -> None:
        """Judge the way from the last pose to this one; a pose that is not newer than the last is ignored.

        Raises UnjudgeableError when the vehicle touches a wall or the goal where it is first seen.
        """
        if self.verdict is not None or (self._last is not None and time <= self._last[0]):
            return
        start, self._last = self._last, (time, pose)
        if start is None:
            self._check_start(pose)
        elif self._elapsed(time) > self.track.max_time:
            self._out_of_time()
        elif self._elapsed(time) >= 0:
            self._judge(start, time, pose)

    def _elapsed(self, time: int) -> float:
        if self._zero is None:
            self._zero = time
        return (time - self._zero) / MICROSECONDS

    def _check_start(self, pose: Pose) -> None:
        rectangle = outline(pose, self.box)
        for kind, obstacles in (("wall", self.track.walls), ("goal", self.track.goal)):
            name = _touched(obstacles, rectangle)
            if name is not None:
                raise UnjudgeableError(f"the vehicle stands on {kind} {name} from the start, {_place(pose)}")

    def _judge(self, start: tuple[int, Pose], time: int, pose: Pose) -> None:
        way = swept(start[1], pose, self.box)
        self._measures.move(start, (time, pose))
        self._measures.approach(way, self.track.walls.values())
        wall, goal = _touched(self.track.walls, way), _touched(self.track.goal, way)
        if wall is not None:
            self._decide("failed", f"hit wall {wall} after {self._elapsed(time):.2f} s {_place(pose)}")
        elif goal is not None:
            self._measures.time_to_goal = self._elapsed(time)
            self._decide("passed", f"reached {goal} after {self._elapsed(time):.2f} s")

    def _out_of_time(self) -> None:
        span = f"{self.track.max_time:.2f} s"
        self._give_up(f"within {span}", f"for {span}")

    def _give_up(self, within: str, during: str) -> None:
        if self._last is None:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {within}")
        silent = [name for name in REQUESTS if name not in self._heard]
        aside = f"; the application sent no {silent[0]}" if silent else ""
        if len(silent) == len(REQUESTS):
            self._decide("failed", f"the application sent no {' and no '.join(silent)} {within}")
        elif self.track.goal:
            self._decide("failed", f"{self._missed(self._last[1], within)}{aside}")
        else:
            self._decide("passed", f"stayed clear of {' and '.join(self.track.walls)} {during}{aside}")

    def _missed(self, pose: Pose, within: str) -> str:
        name, goal = next(iter(self.track.goal.items()))
        away = shapely.distance(goal, outline(pose, self.box))
        return f"did not reach {name} {within}: the vehicle is {_place(pose)}, {away:.2f} m from it"

    def _decide(self, outcome: Literal["passed", "failed"], reason: str) -> None:
        goal = (self._measures.goal_check(self.track.max_time),) if self.track.goal else ()
        walls = (self._measures.wall_check(),) if self.track.walls else ()
        self.verdict = Verdict(outcome, reason, (*goal, *walls, *self._measures.drive_checks()))


def _touched(obstacles: Mapping[str, shapely.MultiLineString], area: shapely.Geometry) -> str | None:
    return next((name for name, lines in obstacles.items() if shapely.intersects(lines, area)), None)


def _place(pose: Pose) -> str:
    return f"at x = {pose.x:z.2f} m, y = {pose.y:z.2f} m"
