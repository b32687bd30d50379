"""The judge of a closed loop: gates and goal are to be reached in time, and no wall touched on the way."""

import math
from typing import Literal

import shapely

from services.base import Verdict
from services.collision.gates import Gates
from services.collision.geometry import Box, Pose, between, outline, swept
from services.collision.measures import Measures
from services.collision.track import Track, fault_of_start, nearest, place, touched

MICROSECONDS = 1_000_000
REQUESTS = ("GroundSteeringRequest", "PedalPositionRequest")


class UnjudgeableError(Exception):
    """There is nothing to judge the application by: the test itself is at fault."""


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
        self._gates = Gates(track.gates)
        self._early = False
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
            fault = fault_of_start(self.track, outline(pose, self.box))
            if fault is not None:
                raise UnjudgeableError(f"{fault}, {place(pose)}")
        elif self._elapsed(time) > self.track.max_time:
            self._out_of_time()
        elif self._elapsed(time) >= 0:
            self._judge(start, time, pose)

    def _elapsed(self, time: int) -> float:
        if self._zero is None:
            self._zero = time
        return (time - self._zero) / MICROSECONDS

    def _judge(self, start: tuple[int, Pose], time: int, pose: Pose) -> None:
        area, when = swept(start[1], pose, self.box), f"after {self._elapsed(time):.2f} s"
        self._measures.move(start, (time, pose))
        wall, (margin, near) = touched(self.track.walls, area), self._approach(area)
        goal = self._reached(start[1], pose, area)
        if wall is not None:
            self._decide("failed", f"hit wall {wall} {when} {place(pose)}")
        elif margin < self.track.min_margin:
            limit = f"it is to keep {self.track.min_margin:g} m away"
            self._decide("failed", f"came within {margin:.3f} m of wall {near} {when} {place(pose)}: {limit}")
        elif goal is not None:
            self._measures.time_to_goal = self._elapsed(time)
            self._decide("passed", f"{goal} {when}")

    def _approach(self, area: shapely.Geometry) -> tuple[float, str]:
        near = nearest(self.track.walls, area)
        if near is not None:
            self._measures.approach(near[0])
        return near or (math.inf, "")

    def _reached(self, start: Pose, end: Pose, area: shapely.Geometry) -> str | None:
        """That the goal was reached after all gates, or the last gate where there is no goal; None when it was not."""
        share = self._gates.move(start, end)
        if share is None:
            self._early = self._early or touched(self.track.goal, area) is not None
            return None
        if self.track.gates and not self.track.goal:
            return f"crossed the last gate, {self.track.gates[-1][0]},"
        rest = area if share == 0.0 else swept(between(start, end, share), end, self.box)
        name = touched(self.track.goal, rest)
        return name and f"reached {name}"

    def _out_of_time(self) -> None:
        span = f"{self.track.max_time:.2f} s"
        self._give_up(f"within {span}", f"for {span}")

    def _give_up(self, within: str, during: str) -> None:
        if self._last is None:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {within}")
        silent = [name for name in REQUESTS if name not in self._heard]
        aside = f"; the application sent no {silent[0]}" if silent else ""
        if len(silent) == len(REQUESTS):
            self._decide("failed", f"the application sent no {' and no '.join(silent)} {within}", unheard=True)
        elif self.track.goal or self.track.gates:
            self._decide("failed", f"{self._missed(self._last[1], within)}{aside}")
        else:
            self._decide("passed", f"stayed clear of {' and '.join(self.track.walls)} {during}{aside}")

    def _missed(self, pose: Pose, within: str) -> str:
        name, lines = self._gates.next or next(iter(self.track.goal.items()))
        away = f"the vehicle is {place(pose)}, {shapely.distance(lines, outline(pose, self.box)):.2f} m from"
        if self._gates.next is None:
            return f"did not reach {name} {within}: {away} it"
        early = f"; {next(iter(self.track.goal))} does not count before the gates" if self._early else ""
        return f"crossed {self._gates.crossed} of {len(self._gates)} gates {within}: {away} {name}, the next{early}"

    def _decide(self, outcome: Literal["passed", "failed"], reason: str, unheard: bool = False) -> None:
        track, measures = self.track, self._measures
        goal = (measures.goal_check(track.max_time),) if track.goal or track.gates else ()
        gates = (measures.gate_check(self._gates.crossed, len(self._gates)),) if track.gates else ()
        walls = (measures.wall_check(track.min_margin),) if track.walls else ()
        self.verdict = Verdict(outcome, reason, (*goal, *gates, *walls, *measures.drive_checks()), unheard)
