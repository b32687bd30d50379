"""The events that a backend reports to the engine while a test runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from msgspec import UNSET, Meta, Struct, UnsetType

from dodo_dsl.outcome import Amount, Check, Evidence, Response, Result, Verdict

MOST_TEXT = 2000
"""Characters that a report can show."""
Say = Callable[[str], None]
"""Shows a sentence while a test or a run goes on."""
Sentence = Annotated[str, Meta(min_length=1, max_length=MOST_TEXT)]


class Said(Struct, tag_field="dodo", frozen=True):
    """What a service says, its kind under ``dodo``; the runner adds its name."""

    service: str


class Ready(Said, tag="ready", frozen=True):
    """It can take what comes: the next layer may start."""


class InputEnded(Said, tag="end-of-input", frozen=True):
    """A source is at its end: an application may end, too."""


class Overrun(Said, tag="lost", frozen=True):
    """A service has lost ``messages`` of the bus up to now, because its receive buffer was full."""

    messages: Annotated[int, Meta(gt=0, le=(1 << 63) - 1)]


class Late(Said, tag="late", frozen=True):
    """Up to now ``late`` of the ``updates`` of a service were late, one of them by ``worst_s``."""

    updates: Annotated[int, Meta(gt=0, le=(1 << 63) - 1)]
    late: Annotated[int, Meta(gt=0, le=(1 << 63) - 1)]
    worst_s: Amount = 0.0


class Paused(Said, tag="paused", frozen=True):
    """What a service emulates has stood still for ``seconds`` so far, as the machine was too busy for it."""

    seconds: Annotated[float, Meta(gt=0)]


class Flooded(Said, tag="flood", frozen=True):
    """More is sent than the recorder takes: ``what`` is the limit in a sentence, ``too_fast`` whether it is the rate's.

    ``share`` of it are messages ``message`` of one ``sender_stamp``.
    """

    what: Sentence
    message: Sentence
    sender_stamp: int
    share: float
    too_fast: bool


class MemoryTaken(Said, tag="taken", frozen=True):
    """A service cannot write its shared memory any more, as a reader of it keeps the lock or has broken it."""

    text: Sentence


class Noted(Struct, tag_field="dodo", tag="note", frozen=True):
    """A note on the test besides its outcome."""

    text: Sentence


class GraphFinding(Struct, tag_field="dodo", tag="ros", frozen=True):
    """What is wrong in the application's ROS graph, a sentence; a test that does not pass may be due to an error."""

    finding: Sentence
    severity: Literal["error", "warning"]


class Foreign(Struct, tag_field="dodo", tag="foreign", frozen=True):
    """The application sent what only others may send; one sentence."""

    reason: Sentence


class Time(Struct, tag_field="dodo", tag="time", frozen=True):
    """How far the clock of a lockstep test is: test time in seconds; ``last`` when it has stopped."""

    seconds: float
    last: bool = False


class Started(Struct, tag_field="dodo", tag="started", frozen=True):
    """The application has started in lockstep, and rests."""


class Rested(Struct, tag_field="dodo", tag="rest", frozen=True):
    """The application rests at a ``time`` of the test in us: the clock waits for what it has printed until then."""

    time: int


class Responded(Struct, tag_field="dodo", tag="response", frozen=True):
    """How long the application took for its answers in lockstep."""

    response: Response


class Stopped(Struct, tag_field="dodo", tag="stopped", frozen=True):
    """The clock of a lockstep test gives up; ``silent`` when nothing came of the application."""

    how: Literal["unanswered", "stuck", "timedout"]
    reason: Annotated[str, Meta(max_length=MOST_TEXT)]
    silent: bool = False


class GivenLimit(Struct, forbid_unknown_fields=True, frozen=True):
    min: int | float | UnsetType = UNSET
    max: int | float | UnsetType = UNSET


class GivenCheck(Struct, forbid_unknown_fields=True, frozen=True):
    name: Sentence
    value: int | float | None
    limit: GivenLimit
    unit: Annotated[str, Meta(max_length=MOST_TEXT)]
    ok: bool
    exclusive: bool | UnsetType = UNSET


class GivenVerdict(Said, tag="verdict", frozen=True):
    """What an evaluator has found; ``silent`` when nothing came of the application."""

    outcome: Literal["passed", "failed"]
    reason: Sentence
    checks: list[GivenCheck]
    evidence: Evidence = {}
    silent: bool = False


Message = (
    Ready | InputEnded | Overrun | Late | Paused | Flooded | MemoryTaken | Noted | Foreign | Time | Started | Rested
    | Responded | Stopped | GivenVerdict
)  # fmt: skip
"""What services say to the runner; besides ``judged``, which is for the report to read."""


@dataclass(frozen=True)
class VerdictEvent:
    """A verdict of an evaluator; its checks have their margins."""

    service: str
    passed: bool
    reason: str
    checks: tuple[Check, ...]
    evidence: Mapping[str, float | str | None] = field(default_factory=dict)
    silent: bool = False

    def as_json(self) -> Verdict:
        outcome = "passed" if self.passed else "failed"
        return {
            "evaluator": self.service, "outcome": outcome, "reason": self.reason, "evidence": dict(self.evidence),
        }  # fmt: skip


Cause = Literal["", "verdict", "end", "silence"]
"""What decided: an evaluator, the end of a service, or an application that did not answer the clock; empty for anything
else."""


@dataclass(frozen=True)
class Finding:
    """One thing that decides an outcome, and the service whose last lines explain it."""

    result: Result
    reason: str
    service: str = ""
    cause: Cause = ""
    silent: bool = False
    """Whether nothing came of the application, which may be on another bus."""


@dataclass(frozen=True)
class Exited:
    """A service has ended; ``code`` is negative for a signal, as in subprocess."""

    service: str
    code: int
    out_of_memory: bool = False


Event = Message | VerdictEvent | Finding | Exited | GraphFinding


class BackendError(Exception):
    """The test cannot be run here; the text is a sentence."""

    usage = False
