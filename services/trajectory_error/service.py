"""The evaluator of estimated poses on the bus."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from services.base import Check, Context, Evaluator, JudgedTime, UnjudgeableError, Verdict
from services.base.clock import MICROSECONDS
from services.trajectory_error import model
from services.trajectory_error.model import Poses, Times

_DIGITS, _FAR, _SHORT = 9, 1e12, 1e-12
_LIMITS = ("ate", "error", "rotation", "rpe", "rpe-rotation")
_MEASURES = {
    "ate": ("m", "the absolute trajectory error is {value}"),
    "mean": ("m", ""),
    "error": ("m", "the largest distance from the true position is {value}"),
    "rotation": ("deg", "the absolute rotation error is {value}"),
    "rotation-error": ("deg", ""),
    "rpe": ("m", "the relative trajectory error over {delta} is {value}"),
    "rpe-rotation": ("deg", "the relative rotation error over {delta} is {value}"),
    "estimates": ("", "estimates with a true pose: {value}"),
    "gap": ("s", "the longest time without an estimate is {value}"),
    "broken": ("", "estimates that are not finite or have no attitude: {value}, the first {when}"),
    "repeated": ("", "estimates with the time of another one: {value}, the first {when}"),
    "unmatched": ("", ""),
}
"""Unit and sentence of each check."""


class TrajectoryError(Evaluator):
    """Takes the vehicle's frames under ``frame-id``, and the application's estimates under ``sender``.

    Sample times are on the clock of the frames, which with a recording is not the test's.
    """

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        self._flags = flags = context.flags
        super().__init__(flags["max-time"])
        self._most = {name: flags[f"max-{name}"] for name in _LIMITS if flags[f"max-{name}"] is not None}
        if flags["delta-unit"] == "frames" and not flags["delta"].is_integer():
            raise ValueError(f"--delta={flags['delta']:g} is not a whole number of frames")
        self._most |= {"gap": flags["max-gap"], "broken": 0, "repeated": 0}
        self._name = f"robot.PoseEstimate/{flags['sender']}"
        self.inputs = {
            ("opendlv.sim.Frame", flags["frame-id"]): self._take_truth,
            ("robot.PoseEstimate", flags["sender"]): self._take,
        }
        self._distances = self.judged.series(f"Distance of {self._name}", "m", high=self._most.get("error"))
        self._angles = self.judged.series(f"Angle of {self._name}", "deg")
        self.forget(0)

    def forget(self, now: int) -> None:
        self._truth: dict[int, list[float]] = {}
        self._estimates: dict[int, list[float]] = {}
        self._faults: dict[str, list[int]] = {"broken": [], "repeated": []}
        self._shift = 0
        self._asides: list[str] = []
        self._evidence: dict[str, float | str | None] = {}

    def _take_truth(self, message: Any, time: int) -> None:
        if (row := _row(message)) is None:
            raise UnjudgeableError("an opendlv.sim.Frame of the vehicle is not finite or has no attitude")
        arrival = time if self.arrival is None else self.arrival
        if not self._truth and abs(arrival - time) > MICROSECONDS:
            self._shift = arrival - time
        self._truth[time] = row

    def _take(self, message: Any, time: int) -> None:
        row = _row(message)
        if row is None or time in self._estimates:
            self._faults["broken" if row is None else "repeated"].append(time)
        else:
            self._estimates[time] = row

    def decide(self, span: JudgedTime) -> Verdict:
        if not self._truth:
            raise UnjudgeableError(f"no opendlv.sim.Frame of the vehicle came {span.within}")
        known, times = (np.array(sorted(each), np.int64) for each in (self._truth, self._estimates))
        most = self._flags["max-diff"]
        number = model.nearest(known, times, round(most * MICROSECONDS))
        if len(times) and (number < 0).all() and np.diff(known, prepend=known[0]).max() > 2 * most * MICROSECONDS:
            raise UnjudgeableError(f"no true pose is within max-diff, {most:g} s, of an estimate: they are too rare")
        counts = {name: len(each) for name, each in self._faults.items()} | {"unmatched": int((number < 0).sum())}
        times = times[number >= 0]
        found = self._errors(times, known[number[number >= 0]]) if len(times) else {}
        hidden = self.hidden_samples if self._shift else self.hidden
        edges = [hidden.shown(time) for time in (int(known[0]), *times.tolist(), int(known[-1]))]
        gap = float(np.diff(edges).max()) / MICROSECONDS
        checks = tuple(self.checks({**found, **counts, "estimates": len(times), "gap": gap}))
        if not len(times) and not any(counts.values()):
            return Verdict("failed", f"no {self._name} came {span.within}", checks, silent=True)
        is_kept = all(check.ok for check in checks)
        told = [self._say(check) for check in checks if not check.ok and (check.value is not None or found)]
        if is_kept:
            kept = ", ".join(f"{c.name} {_told(c)}" for c in checks if c.limit and c.name in _LIMITS)
            told = [f"{len(times)} estimates kept to the true pose: {kept}"]
        reason = "; ".join(told + self._asides)
        return Verdict("passed" if is_kept else "failed", reason, checks, evidence=self._evidence)

    def _errors(self, times: Times, known: Times) -> dict[str, float]:
        """Errors by their names; none where the estimates cannot be aligned. Raises UnjudgeableError if none can."""
        truth = model.poses(np.array([self._truth[time] for time in known.tolist()]))
        given = model.poses(np.array([self._estimates[time] for time in times.tolist()]))
        if self._flags["align"] == "origin":
            given = model.moved_by_first(given, truth)
        elif self._flags["align"] == "se3":
            way = np.array([row[:3] for row in self._truth.values()])
            if model.is_open(way, way):
                raise UnjudgeableError("the true way is straight, which leaves 'align: se3' open")
            if model.is_open(given.positions, truth.positions):
                self._asides.append("the way of the estimates is straight, which leaves 'align: se3' open")
                return {}
            given = model.moved_by_all(given, truth)
        return self._compare(times, truth, given)

    def _compare(self, times: Times, truth: Poses, moved: Poses) -> dict[str, float]:
        away, turned = model.absolute(truth, moved)
        for time, distance, angle in zip(times.tolist(), away.tolist(), turned.tolist(), strict=True):
            self._distances.add(time + self._shift, distance)
            self._angles.add(time + self._shift, angle)
        at = int(np.argmax(away))
        (x, y, _), (guess_x, guess_y, _), time = truth.positions[at], moved.positions[at], int(times[at])
        self._asides.append(f"farthest {self._when(time)}: {away[at]:.3f} m and {turned[at]:.3f} deg")
        self._evidence = {"time": self.elapsed(time + self._shift), "x": x, "y": y}
        self._evidence |= {"estimate-x": guess_x, "estimate-y": guess_y}
        found = {"ate": model.rmse(away), "mean": float(away.mean()), "error": float(away.max()),
                 "rotation": model.rmse(turned), "rotation-error": float(turned.max())}  # fmt: skip
        steps = {"frames": np.ones(len(times) - 1), "s": np.diff(times),
                 "m": np.linalg.norm(np.diff(moved.positions, axis=0), axis=1)}  # fmt: skip
        unit = self._flags["delta-unit"]
        ends = model.ends(steps[unit].tolist(), self._flags["delta"] * (MICROSECONDS if unit == "s" else 1))
        if len(ends) > 1:
            found["rpe"], found["rpe-rotation"] = map(model.rmse, model.relative(truth, moved, ends))
        return {name: round(value, _DIGITS) for name, value in found.items()}

    def checks(self, found: Mapping[str, float]) -> Iterator[Check]:
        """Measures by their names, each with its limit."""
        for name, (unit, _) in _MEASURES.items():
            if name == "estimates":
                yield Check.least(name, found.get(name), self._flags["min-estimates"])
            else:
                yield Check.most(name, found.get(name), self._most.get(name), unit)

    def _say(self, check: Check) -> str:
        delta, when = (
            "{delta:g} {delta-unit}".format(**self._flags),
            self._when([*self._faults.get(check.name, ()), 0][0]),
        )
        return _MEASURES[check.name][1].format(value=_told(check), delta=delta, when=when)

    def _when(self, time: int) -> str:
        return f"at {self.elapsed(time + self._shift):.2f} s"


build = TrajectoryError


def _row(pose: Any) -> list[float] | None:
    """A row of ``model.poses``; None for one that nothing can be computed of."""
    row = [pose.x, pose.y, pose.z, pose.qx, pose.qy, pose.qz, pose.qw]
    squares = [value * value for value in row]
    return row if sum(squares) < _FAR**2 and sum(squares[3:]) > _SHORT**2 else None


def _told(check: Check) -> str:
    return f"{check.told} {check.unit if isinstance(check.value, float) else ''}".rstrip() + f" ({check.bound})"
