"""What became of a test, and how far its checks are from their limits."""

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dodo_dsl.spec.model import Goal

Result = Literal["passed", "failed", "error"]
ON_EMULATED = "on an emulated rig: no hardware took part"
NEXT_REPORT = ".next-"
"""How the name of a folder inside a report's begins in which the next report is written."""


@dataclass(frozen=True)
class Wait:
    """What some services of a test ran on processors together, and how long one of them waited for one; times in s.

    ``longest`` is the service that waited the longest; ``displaced_s`` is the part of its wait in which the machine was
    full and others than the application took most of it.
    """

    ran_s: float
    waited_s: float
    displaced_s: float
    longest: str


@dataclass(frozen=True)
class MachineLoad:
    """How busy the machine was during a test in real time; times in s, None for what was not measured."""

    duration_s: float
    cores: int | None = None
    application: Wait | None = None
    services: Wait | None = None
    """DoDo's own, of the same test."""
    others_share: float | None = None
    """Share of the cores that others than this test took."""
    crowded_s: float | None = None
    """For how long the machine was full, and others than the application took most of it."""
    late_pictures_share: float = 0.0
    """Share of the pictures that came later than half a period."""
    late_updates_share: float = 0.0
    """Share of the updates of any other of DoDo's services, the one with the largest."""
    lateness_s: float = 0.0
    """How late an update of DoDo's services ended, at worst."""
    paused_s: float = 0.0
    """For how long the emulated rig stood still, because it could not keep real time."""
    undecided: bool = False
    """Whether a test that failed is in error, as the machine was too busy."""


SLOW_ANSWERS = "slow-answers"
"""The check of how long answers took."""
PEAK_MEMORY, MEMORY_GROWTH = "peak-memory", "memory-growth"
PROCESSOR_TIME, PROCESSOR_SHARE = "processor-time", "processor-share"
"""The checks of what each of the application's services uses, ``peak-memory-steering`` for example."""
_OF_USE = tuple(f"{name}-" for name in (PEAK_MEMORY, MEMORY_GROWTH, PROCESSOR_TIME, PROCESSOR_SHARE))


def differs_each_run(check: str) -> bool:
    """Whether a check measures the program and the machine, so that lockstep does not make its value the same."""
    return check == SLOW_ANSWERS or check.startswith(_OF_USE)


SAMPLE_TIMES = "uncopied-sample-times"
"""The check of how many answers lacked the sample times of their frames."""


@dataclass(frozen=True)
class Response:
    """How long the application took for an answer in lockstep, without the first; times in s.

    The time is the wall time less what the application waited for a processor. ``processor_*`` is the processor time,
    None if the application's processes cannot be seen from the test's services. ``slow`` counts answers that took
    longer than the period of the frames, ``over`` those beyond the limit of the test, None without one, ``uncopied``
    those that did not carry the sample time of their frame. ``surplus`` counts answers beyond the one that counts for
    a frame, ``surplus_frames`` the frames with any, and ``differing`` those of them that say something else. In
    ``unasked`` of the ``pauses``, in which no frame is shown, the application went on sending, by its own clock.
    """

    answers: int
    period_s: float
    median_s: float
    p95_s: float
    worst_s: float
    processor_median_s: float | None
    processor_p95_s: float | None
    processor_worst_s: float | None
    slow: int
    over: int | None
    processor: str
    """The processor by its name, with its clock."""
    uncopied: int = 0
    worst_frame: int = 0
    """The number of the frame whose answer took the longest, from 1 on; 0 if that is not known."""
    surplus: int = 0
    surplus_frames: int = 0
    differing: int = 0
    pauses: int = 0
    unasked: int = 0

    def in_words(self) -> str:
        """The times in a sentence, with the processor that they were measured on."""
        times = f"{_ms(self.median_s)} (median), {_ms(self.p95_s)} (95 %), {_ms(self.worst_s)} (worst)"
        share = "" if self.processor_median_s is None else f", {_ms(self.processor_median_s)} of it on the processor"
        return f"an answer took {times}{share}" + (f", on {self.processor}" if self.processor else "")


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


@dataclass(frozen=True)
class ServiceUse:
    """What a service of the application used from the start of the test to its end, with all its processes.

    ``processor_share`` is its processor time by the test's own time, 1 for one processor all the time.
    ``memory_growth_bytes_per_s`` is that of the second half of the test, by the test's own time, 0 if it does not
    grow steadily, None if the test was too short to measure. ``memory_limit_bytes`` is None if there is none.
    """

    service: str
    processor_s: float
    processor_share: float | None
    peak_memory_bytes: int
    memory_growth_bytes_per_s: float | None
    memory_limit_bytes: int | None

    def in_words(self) -> str:
        """The figures in a line."""
        share = "" if self.processor_share is None else f" ({self.processor_share * 100:.0f} % of a processor)"
        used = f"{self.processor_s:.2f} s of processor time{share}, up to {megabytes(self.peak_memory_bytes)} of memory"
        growth = self.memory_growth_bytes_per_s
        if growth is None:
            return f"{used}, and the test was too short to measure its growth"
        return f"{used}, growing by {megabytes(growth * 60)}/min" if growth else used


def megabytes(size: float) -> str:
    """A number of bytes in MB, with three digits at least."""
    number = size / 1e6
    return f"{number:,.0f} MB" if number >= 100 or not number else f"{number:.3g} MB"


@dataclass(frozen=True)
class Outcome:
    """What became of a test; times in seconds, None if the test did not get so far."""

    name: str
    slug: str
    spec: str
    level: str
    kind: str
    outcome: Result
    reason: str
    cid: int
    seed: int
    clock: str
    backend: str
    setup_s: float | None = None
    execution_s: float | None = None
    sim_s: float | None = None
    services: tuple[dict[str, Any], ...] = ()
    checks: tuple[dict[str, Any], ...] = ()
    verdicts: tuple[dict[str, Any], ...] = ()
    """Of each evaluator: its name, outcome, reason, and ``evidence``, the data of its decision."""
    last_lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    description: str = ""
    machine: MachineLoad | None = None
    response: Response | None = None
    resources: tuple[ServiceUse, ...] = ()
    """Of the application's services; empty if nothing was measured."""
    goals: tuple[Goal, ...] = ()


@dataclass(frozen=True)
class NotRun:
    """A test of a run that never began, and why in words; it has no outcome."""

    name: str
    slug: str
    spec: str
    level: str
    reason: str


def with_margin(check: Mapping[str, Any]) -> dict[str, Any]:
    """A check with its ``margin`` and ``margin_share``, None if it has no value or no limit.

    ``margin`` is the distance of the value to its nearest limit in the check's unit, negative beyond the limit.
    ``margin_share`` is margin / (abs(margin) + size), which lies between -1 and 1 and is 0 at the limit. The size is
    half the range between both limits, that of the limit if there is one, and one unit if that is 0. It agrees
    with ``ok``: a check that holds has no negative share, and one that fails at its limit or within has -1, as a wall
    that is touched.
    """
    return {**check, "margin": (margin := _margin(check)), "margin_share": _share(check, margin)}


def worst_margin(outcome: Outcome) -> float | None:
    """How far a test is from failing, -1 to 1: the least share of its checks; negative exactly if it failed.

    None for an error, -1 for a failed test without a failing check that has a value. A check that holds with nothing
    to spare does not count, as three gates of three or no broken sample: it cannot be better. Nor does what differs
    from run to run, as the time of answers. 0 if no check is left of a passed test. A check that fails at its
    limit, as a wall that is touched, does not say by how much, and counts only if no other check that failed does.
    """
    if outcome.outcome == "error":
        return None
    is_failed = outcome.outcome == "failed"
    counting = [
        check
        for check in outcome.checks
        if check["ok"] is not is_failed and (is_failed or not differs_each_run(check["name"]))
    ]
    shares = (check.get("margin_share") for check in counting if not is_failed or (check.get("margin") or 0.0) < 0)
    return min((share for share in shares if share), default=-1.0 if is_failed else 0.0)


def failed_checks(outcome: Outcome) -> tuple[str, ...]:
    """The names of the checks that failed, but for those that differ from run to run."""
    names = {check["name"] for check in outcome.checks if not check["ok"]}
    return tuple(sorted(name for name in names if not differs_each_run(name)))


def numbered(checks: Sequence[Mapping[str, Any]]) -> dict[tuple[str, int], Mapping[str, Any]]:
    """By name, and how many of that name came before it, as several evaluators may have one."""
    counts: Counter[str] = Counter()
    found = {}
    for check in checks:
        found[check["name"], counts[check["name"]]] = check
        counts[check["name"]] += 1
    return found


def _margin(check: Mapping[str, Any]) -> float | None:
    value, limit = check["value"], check["limit"]
    distances = []
    if value is not None and "min" in limit:
        distances.append(float(value) - float(limit["min"]))
    if value is not None and "max" in limit:
        distances.append(float(limit["max"]) - float(value))
    if not distances:
        return None
    return max(-sys.float_info.max, min(sys.float_info.max, *distances))


def _share(check: Mapping[str, Any], margin: float | None) -> float | None:
    if margin is None:
        return None
    if not check["ok"] and margin >= 0:
        return -1.0
    if margin == 0 or (check["ok"] and margin < 0):
        return 0.0
    return math.copysign(max(1 / (1 + _size(check["limit"]) / abs(margin)), sys.float_info.min), margin)


def _size(limit: Mapping[str, float]) -> float:
    bounds = [float(bound) for bound in limit.values()]
    return abs(max(bounds) / 2 - min(bounds) / 2) or abs(bounds[0]) or 1.0
