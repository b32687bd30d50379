"""What a backend is, and the events that it reports to the engine while a test runs."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Protocol

from msgspec import Meta

from dodo_dsl.outcome import Check, Response, Verdict
from dodo_dsl.run.machine_load.service_use import Snapshot

MOST_TEXT = 2000
"""Characters that a report can show."""
Say = Callable[[str], None]
"""Shows a sentence while a test or a run goes on."""
Sentence = Annotated[str, Meta(min_length=1, max_length=MOST_TEXT)]


@dataclass(frozen=True)
class Ready:
    service: str


@dataclass(frozen=True)
class VerdictEvent:
    """A well-formed verdict line of an evaluator; its checks have their margins."""

    service: str
    passed: bool
    reason: str
    checks: tuple[Check, ...]
    evidence: Mapping[str, float | str | None] = field(default_factory=dict)

    def as_json(self) -> Verdict:
        """The verdict in ``results.json``."""
        outcome = "passed" if self.passed else "failed"
        return {
            "evaluator": self.service, "outcome": outcome, "reason": self.reason, "evidence": dict(self.evidence),
        }  # fmt: skip


@dataclass(frozen=True)
class Malformed:
    """A line that should be a verdict and is not one."""

    service: str
    problem: str


@dataclass(frozen=True)
class Recorded:
    """A line of what an evaluator judged over time, for the report."""

    service: str


@dataclass(frozen=True)
class Exited:
    """A service has ended; ``code`` is negative for a signal, as in subprocess."""

    service: str
    code: int
    out_of_memory: bool = False


@dataclass(frozen=True)
class Overrun:
    """A service has lost ``messages`` of the bus up to now, because its receive buffer was full."""

    service: str
    messages: Annotated[int, Meta(gt=0, le=(1 << 63) - 1)]


@dataclass(frozen=True)
class Late:
    """Up to now ``late`` of the ``updates`` of a service were late, one of them by ``worst_s``."""

    service: str
    updates: Annotated[int, Meta(le=(1 << 63) - 1)]
    late: Annotated[int, Meta(gt=0)]
    worst_s: Annotated[float, Meta(ge=0)] = 0.0


@dataclass(frozen=True)
class Paused:
    """What a service emulates has stood still for ``seconds`` so far, as the machine was too busy for it."""

    service: str
    seconds: Annotated[float, Meta(gt=0)]


@dataclass(frozen=True)
class Flooded:
    """More is sent than the recorder takes: ``what`` is the limit in a sentence, ``too_fast`` whether it is the rate's.

    ``share`` of it are messages ``message`` of one ``sender_stamp``.
    """

    service: str
    what: Sentence
    message: Sentence
    sender_stamp: int
    share: float
    too_fast: bool


@dataclass(frozen=True)
class MemoryTaken:
    """A service cannot write its shared memory any more, as a reader of it keeps the lock or has broken it."""

    service: str
    text: Sentence


@dataclass(frozen=True)
class Noted:
    """A note on the test besides its outcome."""

    text: Sentence


@dataclass(frozen=True)
class Foreign:
    """The application sent what only others may send; one sentence."""

    reason: Sentence


@dataclass(frozen=True)
class InputEnded:
    """A source is at its end: an application may end, too."""

    service: str


@dataclass(frozen=True)
class Unstartable:
    service: str
    why: str


@dataclass(frozen=True)
class Lost:
    """The backend itself is gone."""

    why: str


@dataclass(frozen=True)
class Time:
    """How far the clock of a lockstep test is: test time in seconds; ``last`` when it has stopped."""

    seconds: float
    last: bool = False


@dataclass(frozen=True)
class Responded:
    """How long the application took for its answers in lockstep."""

    response: Response


@dataclass(frozen=True)
class Stopped:
    """The clock of a lockstep test gives up: ``kind`` is unanswered, stuck or timedout."""

    kind: str
    reason: Annotated[str, Meta(max_length=MOST_TEXT)]


@dataclass(frozen=True)
class Unmatched:
    """What a service printed since one of its lines last matched, in words; ``never`` if none did."""

    service: str
    words: str
    never: bool


Event = (
    Ready
    | VerdictEvent
    | Malformed
    | Recorded
    | Overrun
    | Late
    | Paused
    | Flooded
    | MemoryTaken
    | Noted
    | Foreign
    | InputEnded
    | Exited
    | Unstartable
    | Lost
    | Time
    | Responded
    | Stopped
)


class Backend(Protocol):
    """Where a test's services run. ``open`` raises BackendError, the rest reports through events."""

    name: str
    cid: int

    @property
    def is_on_host(self) -> bool:
        """Whether the application has the machine's own ``/tmp``, shared memory and IPC."""
        ...

    async def open(self) -> None: ...

    async def start(self, layer: str) -> dict[str, bool]:
        """Starts the services of a layer; returns their names, and whether each will report that it is ready."""
        ...

    async def next_event(self) -> Event: ...

    async def listeners(self) -> Collection[str] | None:
        """The services of the application that listen on an OpenDLV bus already; None if that cannot be seen."""
        ...

    async def begin(self) -> None:
        """Announces on the test's bus that everything is ready; may be repeated."""
        ...

    async def use(self) -> Snapshot | None:
        """What the test's services used so far; None if that cannot be measured."""
        ...

    async def application(self) -> Collection[int] | None:
        """Processes of this machine of which the application's are, or descend; None if they are not known."""
        ...

    async def close(self, keep: bool) -> list[str]:
        """Ends everything and cleans up; with ``keep``, leaves it and returns sentences on how to look inside."""
        ...

    def tail(self, service: str) -> list[str]:
        """The last lines that a service wrote."""
        ...

    def unmatched(self) -> tuple[Unmatched, ...]:
        """Of each service of the application whose lines are messages, those that matched nothing."""
        ...


class BackendError(Exception):
    """The test cannot be run here; the text is a sentence."""
