"""The evaluator of a closed loop: gates and goal are to be reached in time, and no wall touched before.

Checks are made of measures taken while the vehicle drives, and of the application's requests: which came, and for how
long none did.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import shapely

from dodo_dsl.opendlv.assets.track import (
    Gates,
    Goal,
    Track,
    VehicleBox,
    VehiclePose,
    between,
    fault_of_start,
    length_through,
    nearest,
    outline,
    place,
    swept,
    told,
    touched,
)
from dodo_dsl.opendlv.envelope import MICROSECONDS
from services.base import Check, Evaluator, JudgedTime, UnjudgeableError, Verdict
from services.collision.bodies import Approach, Footprints, OtherBody


@dataclass
class DriveMeasures:
    """Distance driven (m), highest speed (m/s), smallest distances to a wall and a body (m), time to the goal (s)."""

    distance: float = 0.0
    max_speed: float | None = None
    wall_margin: float | None = None
    body_margin: float | None = None
    time_to_goal: float | None = None

    def move(self, start: tuple[int, VehiclePose], end: tuple[int, VehiclePose]) -> float:
        """The vehicle went from one pose to the next, each with its time in microseconds; returns its speed."""
        length = math.hypot(end[1].x - start[1].x, end[1].y - start[1].y)
        speed = length * MICROSECONDS / (end[0] - start[0])
        self.distance += length
        self.max_speed = max(self.max_speed or 0.0, speed)
        return speed

    def approach(self, margin: float) -> None:
        self.wall_margin = margin if self.wall_margin is None else min(self.wall_margin, margin)

    def checks(self, track: Track, crossed: int, rest: float | None, has_bodies: bool) -> Iterator[Check]:
        """Those of a track; the ``rest`` in m to the goal decides nothing, but shows how far a drive came."""
        arrived, gates = self.time_to_goal, len(track.gates)
        if track.goal or gates:
            yield Check.most("time-to-goal", arrived, track.max_time, "s", ("max-time", "goal"))
            if rest is not None:
                yield Check.most("to-goal", rest, 0.0, "m", ("goal", "gates"))
        if gates:
            yield Check.least("gates", crossed, gates)
        if track.walls:
            yield _margin_check("wall-margin", self.wall_margin, track.min_margin, ("min-margin", "walls"))
        if has_bodies:
            yield _margin_check("body-margin", self.body_margin, track.min_body_margin, ("min-body-margin", "bodies"))
        yield Check.least("distance", self.distance, track.min_distance or None, "m")
        yield Check.most("max-speed", self.max_speed, track.max_speed, "m/s")


def _margin_check(name: str, margin: float | None, limit: float, flags: tuple[str, ...]) -> Check:
    """The margin, at least its limit, or more than a limit of zero: a wall touched is a wall hit."""
    is_kept = margin is not None and margin >= limit and margin > 0.0
    return Check(name, margin, {"min": limit}, "m", is_kept, exclusive=limit <= 0.0, parameters=flags)


REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")


class Requests:
    """Requests by message names; ``max_silence`` s may pass between any two of them. Times in us.

    Time before the first request is not silence: ``max_time`` limits that.
    """

    def __init__(self, names: Sequence[str] = REQUESTS, max_silence: float = math.inf) -> None:
        self.names = tuple(names)
        self.came: set[str] = set()
        self._max_silence = max_silence
        self._last: int | None = None
        self._longest = 0

    def take(self, name: str, now: int | None) -> None:
        """The application sent a request; ``now`` is None while no time is known."""
        self.came.add(name)
        if now is not None:
            self.elapse(now)
            self._last = max(now, self._last or 0)

    def elapse(self, now: int) -> None:
        if self.came and self._last is None:
            self._last = now
        if self._last is not None:
            self._longest = max(self._longest, now - self._last)

    def forget(self, now: int) -> None:
        """The test begins: silence before it does not count."""
        self._last, self._longest = now if self.came else None, 0

    @property
    def missing(self) -> list[str]:
        return [name.rpartition(".")[2] for name in self.names if name not in self.came]

    @property
    def is_silent(self) -> bool:
        return not self.came

    def fault(self, now: int, zero: int) -> str | None:
        """That no request came for too long up to now; None when that is not so."""
        self.elapse(now)
        if self._last is None or now - self._last <= self._max_silence * MICROSECONDS:
            return None
        begin, end = ((each - zero) / MICROSECONDS for each in (self._last, now))
        return f"no request came between {begin:.2f} s and {end:.2f} s (at most {self._max_silence:g} s)"

    def checks(self) -> tuple[Check, ...]:
        if math.isinf(self._max_silence):
            return ()
        longest = self._longest / MICROSECONDS if self.came else None
        return (Check.most("silence", longest, self._max_silence, "s"),)


PERIOD = 10_000  # us
_CLOSE = 1e-3
"""A wall farther away than this, in m, is not touched."""


class TrackEvaluator(Evaluator):
    """Judges the vehicle's poses in test time (microseconds).

    Time zero is the first of ``begin`` and the application's first request; while there is neither, the first
    update. Poses from before time zero show where the vehicle starts and are not judged.
    """

    period = PERIOD

    def __init__(
        self, track: Track, box: VehicleBox, requests: Requests | None = None, bodies: Footprints | None = None
    ) -> None:
        super().__init__(track.max_time)
        self.track = track
        self.box = box
        self._measures = DriveMeasures()
        self._gates = Gates(track.gates)
        self._early = False
        self._begin: VehiclePose | None = None
        self._goal: Goal | None = None
        self._requests = requests or Requests()
        self._last: tuple[int, VehiclePose] | None = None
        self._closest: dict[str, float | str | None] = {}
        least = track.min_margin
        self._margins = self.judged.series("Distance to the walls", "m", low=least, exclusive=least <= 0.0)
        self._speeds = self.judged.series("Speed", "m/s", high=track.max_speed)
        self._bodies = {stamp: OtherBody(*about, box) for stamp, about in (bodies or {}).items()}
        self._nearest: dict[str, float | str | None] = {}
        least = track.min_body_margin
        self._gaps = (
            self.judged.series("Distance to other bodies", "m", low=least, exclusive=least <= 0.0) if bodies else None
        )

    def forget(self, now: int) -> None:
        self._measures = DriveMeasures()
        self._closest, self._nearest = {}, {}
        self._requests.forget(now)

    def request(self, name: str) -> None:
        """The application sent one of its requests; it counts by its arrival, not by its own clock."""
        self._requests.take(name, self.arrival)
        if self.now is not None:
            self.begin(self.now)

    def advance(self, now: int) -> None:
        if not self._requests.is_silent:
            self.begin(now)
        fault = self._requests.fault(now, self.zero)
        if fault is not None and not self.is_overdue(now):
            self.verdict = self._verdict("failed", fault)

    def look(self, pose: VehiclePose, time: int) -> None:
        """Judge the path from the last pose to this one; a pose that is not newer than the last is ignored.

        Raises UnjudgeableError when the vehicle touches a wall or the goal where it is first seen.
        """
        if self.verdict is not None or (self._last is not None and time <= self._last[0]):
            return
        start, self._last = self._last, (time, pose)
        for body in self._bodies.values():
            body.take_vehicle(time, pose)
        if start is None:
            fault = fault_of_start(self.track, pose, self.box)
            if fault is not None:
                raise UnjudgeableError(fault)
        elif self.is_overdue(time):
            self.time_is_over()
        elif self.elapsed(time) >= 0:
            self._judge(start, time, pose)
        self._judge_bodies()

    def look_at_body(self, stamp: int, pose: VehiclePose, time: int) -> None:
        """Judge how close the vehicle has come to a body, which is now here; raises UnjudgeableError as ``look``."""
        self._bodies[stamp].take(time, pose)
        self._judge_bodies()

    def _judge_bodies(self) -> None:
        for body in self._bodies.values():
            first, limit = body.first(), self.track.min_body_margin
            if first is not None and (first <= 0.0 or first < limit):
                far = "touches the vehicle" if first <= 0.0 else f"is {told(first, limit)} m from the vehicle"
                raise UnjudgeableError(f"body {body.name} {far} when it is first seen")
            for approach in body.approaches():
                if self.verdict is None and self.elapsed(approach.time) >= 0 and not self.is_overdue(approach.time):
                    self._judge_approach(body.name, approach)

    def _judge_approach(self, name: str, approach: Approach) -> None:
        """The evidence has the vehicle's newest pose, which is hardly newer than this."""
        time, margin = approach
        before, limit = self._measures.body_margin, self.track.min_body_margin
        if self._gaps:
            self._gaps.add(time, margin)
        if before is None or margin < before:
            self._measures.body_margin = margin
            self._nearest = {"closest-body": name, **self._moment("closest-body-")}
        when = f"after {self.elapsed(time):.2f} s {place(self._last[1])}" if self._last else ""
        if margin <= 0.0:
            self.verdict = self._verdict("failed", f"hit body {name} {when}", obstacle=name)
        elif margin < limit:
            close = f"came within {told(margin, limit)} m of body {name} {when}, expected at least {limit:g} m"
            self.verdict = self._verdict("failed", close, obstacle=name)

    def _has_failed_by_bodies(self, within: str) -> bool:
        """Judge bodies up to the vehicle's newest pose; raises UnjudgeableError for one that was not seen."""
        for body in self._bodies.values():
            body.hold()
            if not body.was_seen:
                raise UnjudgeableError(f"no opendlv.sim.Frame of body {body.name} came {within}")
        self._judge_bodies()
        return self.verdict is not None

    def _judge(self, start: tuple[int, VehiclePose], time: int, pose: VehiclePose) -> None:
        self._begin = self._begin or start[1]
        area, when = swept(start[1], pose, self.box), f"after {self.elapsed(time):.2f} s"
        self._speeds.add(time, self._measures.move(start, (time, pose)))
        margin, near = self._approach(area)
        if self.track.walls:
            self._margins.add(time, margin)
        wall = touched(self.track.walls, area) if margin < _CLOSE else None
        goal = self._reached(start[1], pose, area)
        if wall is not None:
            self.verdict = self._verdict("failed", f"hit wall {wall} {when} {place(pose)}", obstacle=wall)
        elif margin < self.track.min_margin:
            close = f"came within {told(margin, self.track.min_margin)} m of wall {near} {when} {place(pose)}"
            expected = f"expected at least {self.track.min_margin:g} m"
            self.verdict = self._verdict("failed", f"{close}, {expected}", obstacle=near)
        elif self.track.max_speed is not None and (speed := self._measures.max_speed or 0.0) > self.track.max_speed:
            drove = f"drove {told(speed, self.track.max_speed)} m/s {when} {place(pose)}"
            fast = f"{drove}, expected at most {self.track.max_speed:g} m/s"
            self.verdict = self._verdict("failed", fast)
        elif goal is not None and not self._has_failed_by_bodies(f"before the vehicle {goal}"):
            self._measures.time_to_goal = self.elapsed(time)
            self.verdict = self._arrived(f"{goal} {when}", time)

    def _arrived(self, reason: str, time: int) -> Verdict:
        """The goal was reached: by the application only if it went on with its requests."""
        fault = self._requests.fault(time, self.zero) or self._short()
        if self._requests.is_silent:
            fault = f"the application sent no {' and no '.join(self._requests.missing)}"
        if fault is None:
            return self._verdict("passed", reason)
        return self._verdict("failed", f"{fault}, although the vehicle {reason}", self._requests.is_silent)

    def _short(self) -> str | None:
        least, driven = self.track.min_distance, self._measures.distance
        return None if driven >= least else f"drove {told(driven, least)} m, expected at least {least:g} m"

    def _approach(self, area: shapely.Geometry) -> tuple[float, str]:
        near = nearest(self.track.walls, area)
        if near is not None:
            before = self._measures.wall_margin
            self._measures.approach(near[0])
            if before is None or near[0] < before:
                self._closest = {"closest-wall": near[1], **self._moment("closest-")}
        return near or (math.inf, "")

    def _reached(self, start: VehiclePose, end: VehiclePose, area: shapely.Geometry) -> str | None:
        """That the goal was reached after all gates, or the last gate if there is no goal; None when it was not."""
        share, goal = self._gates.move(start, end), self.track.goal
        if share is None:
            self._early = self._early or touched(goal, area) is not None
            return None
        last = self.track.gates[-1][0] if self.track.gates else ""
        if last and not goal:
            return f"crossed the last gate, {last},"
        rest = area if share == 0.0 else swept(between(start, end, share), end, self.box)
        begin, name = between(start, end, share), touched(goal, rest)
        if name is None:
            return None
        self._goal = self._goal or Goal(self.track, begin if last else self._begin or begin, self.box)
        return f"reached {name}" if self._goal.move(begin, end, rest) or last in goal else None

    def decide(self, span: JudgedTime) -> Verdict:
        if self._last is None:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {span.within}")
        missing, fault = self._requests.missing, self._requests.fault(self.now or self.zero, self.zero)
        if self._requests.is_silent:
            reason = f"the application sent no {' and no '.join(missing)} {span.within}"
            return self._verdict("failed", reason, silent=True)
        if fault is not None:
            return self._verdict("failed", fault)
        aside = f"; the application sent no {' and no '.join(missing)}" if missing else ""
        if self.track.goal or self.track.gates:
            return self._verdict("failed", f"{self._missed(self._last[1], span.within)}{aside}")
        if self._has_failed_by_bodies(span.within) and self.verdict is not None:
            return self.verdict
        if short := self._short():
            return self._verdict("failed", f"{short} {span.within}{aside}")
        clear = " and ".join([*self.track.walls, *(body.name for body in self._bodies.values())])
        did = f"stayed clear of {clear}" if clear else f"drove {self._measures.distance:.2f} m"
        return self._verdict("passed", f"{did} {span.throughout}{aside}")

    def _missed(self, pose: VehiclePose, within: str) -> str:
        name, lines = self._gates.next or next(iter(self.track.goal.items()))
        away = f"the vehicle is {place(pose)}, {shapely.distance(lines, outline(pose, self.box)):.2f} m from"
        if self._gates.next is None:
            behind = (
                "; it came to it from behind, which does not count"
                if self._goal and self._goal.came_from_behind
                else ""
            )
            return f"did not reach {name} {within}: {away} it{behind}"
        early = f"; {next(iter(self.track.goal))} does not count before the gates" if self._early else ""
        return f"crossed {self._gates.crossed} of {len(self._gates)} gates {within}: {away} {name}, the next{early}"

    def _rest(self) -> float | None:
        """How far it is from the newest pose to the goal, by straight lines from gate to gate."""
        if self._measures.time_to_goal is not None or self._last is None:
            return None if self._last is None else 0.0
        left = [lines for _, lines in self.track.gates[self._gates.crossed :]]
        return length_through(outline(self._last[1], self.box), [*left, *self.track.goal.values()])

    def _moment(self, prefix: str = "") -> dict[str, float | str | None]:
        if self._last is None:
            return {}
        time, pose = self._last
        return {f"{prefix}time": self.elapsed(time), f"{prefix}x": pose.x, f"{prefix}y": pose.y}

    def _verdict(
        self, outcome: Literal["passed", "failed"], reason: str, silent: bool = False, obstacle: str | None = None
    ) -> Verdict:
        measured = self._measures.checks(self.track, self._gates.crossed, self._rest(), bool(self._bodies))
        checks = (*measured, *self._requests.checks())
        named = {} if obstacle is None else {"obstacle": obstacle}
        return Verdict(outcome, reason, checks, silent, {**self._moment(), **named, **self._closest, **self._nearest})
