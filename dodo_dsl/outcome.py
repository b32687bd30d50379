"""What became of a test, and how far its checks are from their limits.

``schemas/results.schema.json`` is made of these classes: of a field's type, and of the text below it.
"""

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NotRequired, TypedDict, cast

from msgspec import Meta

from dodo_dsl.spec.model import CLOCKS, KINDS, LAYERS, LEVELS, Goal

Result = Literal["passed", "failed", "error"]
Amount = Annotated[float, Meta(ge=0)]
Count = Annotated[int, Meta(ge=0)]
Measured = Amount | None
Share = Annotated[float, Meta(ge=0, le=1)]
ON_EMULATED = "on an emulated rig: no hardware took part"
NEXT_REPORT = ".next-"
"""How the name of a folder inside a report's begins in which the next report is written."""


def one_of(*words: str) -> Meta:
    """Of a text that is one of these words."""
    return Meta(pattern=f"^({'|'.join(words)})$", extra_json_schema={"enum": list(words)})


@dataclass(frozen=True)
class Wait:
    """What some services of a test ran on processors together, and how long one of them waited for one."""

    ran_s: Amount
    """Seconds on processors, of all services and threads together."""
    waited_s: Amount
    """Seconds for which the busiest thread of the service in 'longest' was ready to run and got no processor."""
    displaced_s: Amount
    """The part of 'waited_s' in which the machine was full and others than the application took most of it."""
    longest: str
    """The service that waited the longest; empty when there is none."""


@dataclass(frozen=True)
class MachineLoad:
    """How busy the machine was during a test in real time."""

    duration_s: Amount
    """Seconds over which the machine was measured: the test's, without set-up."""
    cores: Count | None = None
    """Cores that the test could use; null when the load was not measured."""
    application: Wait | None = None
    """What the application's services ran and waited; null when that was not measured."""
    services: Wait | None = None
    """What DoDo's services of this test ran and waited; null when that was not measured."""
    others_share: Measured = None
    """Share of the cores that others than this test took, 0 to 1; null when that was not measured."""
    crowded_s: Measured = None
    """Seconds in which the machine was full and others than the application took most of it; null when that was not
    measured."""
    late_pictures_share: Share = 0.0
    """Share of the pictures that came later than half a period."""
    late_updates_share: Share = 0.0
    """Share of the other updates of DoDo's services that ended later than half a period, of the service with the
    largest."""
    lateness_s: Amount = 0.0
    """How late an update of DoDo's services ended, at worst; 0 when none was later than half its period."""
    paused_s: Amount = 0.0
    """For how long the emulated rig stood still, because it could not keep real time."""
    undecided: bool = False
    """Whether the test is in error because the machine was too busy to judge a failure."""


SLOW_ANSWERS = "slow-answers"
"""The check of how long answers took."""
PEAK_MEMORY, PROCESSOR_TIME, PROCESSOR_SHARE = "peak-memory", "processor-time", "processor-share"
"""The checks of what each of the application's services uses, ``peak-memory-steering`` for example."""
_OF_USE = tuple(f"{name}-" for name in (PEAK_MEMORY, PROCESSOR_TIME, PROCESSOR_SHARE))


def differs_each_run(check: str) -> bool:
    """Whether a check measures the program and the machine, so that lockstep does not make its value the same."""
    return check == SLOW_ANSWERS or check.startswith(_OF_USE)


SAMPLE_TIMES = "uncopied-sample-times"
"""The check of how many answers lacked the sample times of their frames."""


@dataclass(frozen=True)
class Response:
    """How long the application took for an answer in lockstep."""

    answers: Annotated[int, Meta(ge=1)]
    """Answers that were measured: all but the first."""
    period_s: Amount
    """Period of the frames in seconds of test time."""
    median_s: Amount
    """Processor time of an answer in seconds, over all processes of the application."""
    p95_s: Amount
    """95 % of the answers took at most this."""
    worst_s: Amount
    """The longest time of an answer."""
    slow: Count
    """Answers that took longer than the period of the frames."""
    over: Count | None
    """Answers that took longer than the test allows; null where it sets no limit."""
    processor: str
    """The processor of this machine."""
    uncopied: Count = 0
    """Answers that did not carry the sample time of their frame."""
    worst_frame: Count = 0
    """The number of the frame whose answer took the longest, from 1 on; 0 if that is not known."""

    def in_words(self) -> str:
        """The times in a sentence, with the processor that they were measured on."""
        times = f"{_ms(self.median_s)} (median), {_ms(self.p95_s)} (95 %), {_ms(self.worst_s)} (worst)"
        return f"an answer took {times} on the processor" + (f", on {self.processor}" if self.processor else "")


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


@dataclass(frozen=True)
class ServiceUse:
    """What a service of the application used from the start of the test to its end."""

    service: str
    """The service of the application, with all its processes."""
    processor_s: Amount
    """Processor time in seconds, also of processes that have ended."""
    processor_share: Measured
    """Processor time by the test's own time: 1 is one processor all the time; null where the test had no time."""
    peak_memory_bytes: Count
    """The most memory that was seen, without programs and files that are only read."""

    def in_words(self) -> str:
        """The figures in a line."""
        share = "" if self.processor_share is None else f" ({self.processor_share * 100:.0f} % of a processor)"
        return f"{self.processor_s:.2f} s of processor time{share}, up to {megabytes(self.peak_memory_bytes)} of memory"


def megabytes(size: float) -> str:
    """A number of bytes in MB, with three digits at least."""
    number = size / 1e6
    return f"{number:,.0f} MB" if number >= 100 or not number else f"{number:.3g} MB"


class EndedService(TypedDict):
    """A service of a test, and how it ended."""

    name: str
    """Name in the test."""
    layer: Annotated[str, one_of(*LAYERS, "application")]
    """Layer of the service."""
    uses: str | None
    """Service of DoDo or of the deployment; null for the application's."""
    exit_code: int | None
    """Null when it ran until the end."""


class Limit(TypedDict):
    """Of a check's value."""

    min: NotRequired[int | float]
    """Smallest value that passes, unless 'exclusive' is true."""
    max: NotRequired[int | float]
    """Largest value that passes, unless 'exclusive' is true."""


class Check(TypedDict):
    """A measurement of an evaluator."""

    name: str
    """What was measured."""
    value: int | float | None
    """The value; null when nothing could be measured."""
    limit: NotRequired[Limit]
    """The limits; a value without limits is only reported."""
    unit: NotRequired[str]
    """Unit of value and limits; empty for a bare number."""
    ok: bool
    """Whether the value is within its limits."""
    exclusive: NotRequired[bool]
    """Whether a value at a limit fails, as of a distance that has to be more than 0; false by default."""
    margin: NotRequired[int | float | None]
    """Distance of the value to its nearest limit in the check's unit: 0 at the limit, negative beyond it; null without
    a value or a limit."""
    margin_share: NotRequired[Annotated[float, Meta(ge=-1, le=1)] | None]
    """The margin as margin / (abs(margin) + size), with the limit's size, or half the range between both limits, or 1
    where the limit is 0; negative exactly where the check fails, -1 where it fails at its limit, and null without a
    value or a limit."""


_Key = Annotated[str, Meta(pattern="^[a-z][a-z0-9-]{0,39}$")]
_Datum = int | float | Annotated[str, Meta(max_length=200)] | None
Evidence = Annotated[dict[_Key, _Datum], Meta(max_length=20)]


class Verdict(TypedDict):
    """What an evaluator found."""

    evaluator: str
    """Name in the test."""
    outcome: Annotated[str, one_of("passed", "failed")]
    """What this evaluator found."""
    reason: str
    """One sentence."""
    evidence: Evidence
    """The data of the decision: 'time' in seconds of the test, and what the evaluator saw then and where."""


@dataclass(frozen=True)
class NamedTest:
    """Which test it is."""

    name: str
    """Name of the instance."""
    slug: str
    """The name in folders and jobs."""
    spec: str
    """The spec's file, relative to its repository, or else to its registry."""
    level: Annotated[str, one_of(*LEVELS)]
    """Software, data or hardware in the loop: the world is simulated, recorded or real."""


@dataclass(frozen=True)
class NotRun(NamedTest):
    """A test of a run that never began; it has no outcome."""

    reason: str
    """Why it never began."""


@dataclass(frozen=True)
class Outcome(NamedTest):
    """What became of a test."""

    kind: Annotated[str, one_of(*KINDS)]
    """What was judged: detections, a signal, or driving."""
    outcome: Result
    """failed: the application is to blame; error: the test gave no answer about it."""
    reason: str
    """One sentence."""
    cid: Annotated[int, Meta(ge=1, le=254)]
    """CID of the test's bus."""
    seed: Count
    """Seed of everything random in the test."""
    clock: Annotated[str, one_of(*CLOCKS)]
    """Clock of the test."""
    backend: Annotated[str, one_of("process", "docker", "mixed")]
    """How services were started."""
    setup_s: Measured = None
    """From start until all services were ready."""
    execution_s: Measured = None
    """From ready to the end."""
    sim_s: Measured = None
    """Test time in lockstep, null in real time."""
    services: tuple[EndedService, ...] = ()
    """All services of the test, including the application's."""
    checks: tuple[Check, ...] = ()
    """Measurements of the evaluators, with their limits."""
    verdicts: tuple[Verdict, ...] = ()
    """The verdict of each evaluator."""
    last_lines: tuple[str, ...] = ()
    """Last lines of the decisive service."""
    notes: tuple[str, ...] = ()
    """Further notes on the test, such as messages that the recorder lost."""
    description: str = ""
    """What the application must achieve."""
    machine: MachineLoad | None = None
    """How busy the machine was during a test in real time; null in lockstep."""
    response: Response | None = None
    """How long the application took for its answers in lockstep; null in real time, or without a second answer."""
    resources: tuple[ServiceUse, ...] = ()
    """What each service of the application used from the start of the test to its end; empty if nothing was
    measured."""
    goals: tuple[Goal, ...] = ()
    """The soft goals of the test, for dodo rank."""
    headline: str = ""
    """The check that the test names to be shown first; empty if it names none."""
    decided_by: str = ""
    """The evaluator whose verdict is the outcome; empty if several passed, or something else decided."""


def with_margin(check: Mapping[str, Any]) -> Check:
    """A check with its ``margin`` and ``margin_share``, None if it has no value or no limit.

    ``margin`` is the distance of the value to its nearest limit in the check's unit, negative beyond the limit.
    ``margin_share`` is margin / (abs(margin) + size), which lies between -1 and 1 and is 0 at the limit. The size is
    half the range between both limits, that of the limit if there is one, and one unit if that is 0. It agrees
    with ``ok``: a check that holds has no negative share, and one that fails at its limit or within has -1, as a wall
    that is touched.
    """
    return cast(Check, {**check, "margin": (margin := _margin(check)), "margin_share": _share(check, margin)})


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
