"""The interface of services: a model with inputs and a period, built from flags, and an evaluator's verdict."""

import json
import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal, NamedTuple, Self

from google.protobuf.message import Message

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.clock import MICROSECONDS, Clock, RealTimeClock
from services.base.flags import Flags
from services.base.judged import Judged


@dataclass(frozen=True)
class Check:
    """A measure with its limit, ``min`` and ``max``; no finite value is null.

    A value at a limit passes, unless the limits are ``exclusive``, as of a distance that has to be more than 0.
    ``parameters`` of the manifest set the limit, where they are not ``max-NAME``, ``min-NAME`` or ``NAME``: the report
    shows their lines of the spec.
    """

    name: str
    value: float | None
    limit: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""
    ok: bool = True
    exclusive: bool = False
    parameters: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def most(
        cls, name: str, value: float | None, limit: float | None, unit: str = "", parameters: tuple[str, ...] = ()
    ) -> Self:
        """One that keeps ``limit`` up to it, None for no limit; no value does not keep it."""
        ok = limit is None or (value is not None and value <= limit)
        return cls(name, value, {} if limit is None else {"max": limit}, unit, ok, parameters=parameters)

    @classmethod
    def least(
        cls, name: str, value: float | None, limit: float | None, unit: str = "", parameters: tuple[str, ...] = ()
    ) -> Self:
        """One that keeps ``limit`` from it on, None for no limit; no value does not keep it."""
        ok = limit is None or (value is not None and value >= limit)
        return cls(name, value, {} if limit is None else {"min": limit}, unit, ok, parameters=parameters)

    @property
    def bound(self) -> str:
        """Its limit in a sentence: ``at most 0.5``; empty without one."""
        return "".join(f"at {'most' if side == 'max' else 'least'} {said(at)}" for side, at in self.limit.items())

    @property
    def told(self) -> str:
        """The value in a sentence, in full where rounding would hide that it broke its limit."""
        short = said(self.value)
        return str(self.value) if not self.ok and short in map(said, self.limit.values()) else short

    def as_json(self) -> dict[str, Any]:
        """The check in the verdict line; numbers may come from numpy."""
        return {
            "name": self.name,
            "value": _number(self.value),
            "limit": {key: _number(bound) for key, bound in self.limit.items() if math.isfinite(bound)},
            "unit": self.unit,
            "ok": bool(self.ok),
            **({"exclusive": True} if self.exclusive else {}),
        }


def said(value: float | None) -> str:
    return "nothing" if value is None else str(value) if isinstance(value, int) else f"{value:z.4g}"


SINGLE = 2.0**-24
"""What float fields are exact to, as a share of their value: 0.3 comes as 0.30000001192092896."""


def at_limit(value: float, limit: float | None, exact: float) -> float:
    """A value that is exact to ``exact``; the limit itself where it may be that."""
    return value if limit is None or abs(value - limit) > exact else limit


_MOST_REASON = 2000
"""Characters of a reason: of longer ones the runner takes no verdict."""


@dataclass(frozen=True)
class Verdict:
    """Passed or failed, in one sentence, with checks; ``silent`` when nothing of the application came.

    ``evidence`` is the data of the decision, by lower-case words with hyphens: ``time`` in s of the test, and where and
    what the evaluator saw then. At most 20 numbers or strings of 200 characters; no finite number is null.
    """

    outcome: Literal["passed", "failed"]
    reason: str
    checks: tuple[Check, ...] = ()
    silent: bool = False
    evidence: Mapping[str, float | str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.checks, Check):
            object.__setattr__(self, "checks", (self.checks,))

    def line(self) -> str:
        """The verdict line, without its line break; ASCII, whatever the locale."""
        checks = [check.as_json() for check in self.checks]
        reason = self.reason if len(self.reason) <= _MOST_REASON else self.reason[: _MOST_REASON - 1] + "…"
        message: dict[str, Any] = {"dodo": "verdict", "outcome": self.outcome, "reason": reason, "checks": checks}
        if self.silent:
            message["silent"] = True
        if self.evidence:
            numbers = {key: v if isinstance(v, str) else _number(v) for key, v in self.evidence.items()}
            message["evidence"] = numbers
        return json.dumps(message, allow_nan=False)


def _number(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return value if isinstance(value, int) else float(value)


IDLE_PERIOD = 50_000


class UnusableMessageError(ValueError):
    """A handler cannot use its message: the loop ignores it, and logs the first of each kind and sender."""


Handler = Callable[[Any, int], None]


class Output(NamedTuple):
    """A message to send with its own sender stamp, and a sample time (us) where it is not that of the update."""

    message: Message
    sender_stamp: int
    sample_time: int | None = None


Framed = tuple[Envelope, bytes]
"""An envelope with its frame on the bus; that is made of it where it is empty."""


class Service:
    """A model as the loop sees it; models override what they need.

    ``period`` is in microseconds of test time; None for a model that only messages drive, which is not updated.
    ``inputs`` maps a message's name and sender stamp (None for any) to its handler; ``observe`` gets every
    envelope. Setting ``verdict`` (evaluators) or ``finished`` (sources, in ``update``) ends the service.
    Nothing in a model reads a clock, sleeps or touches the bus.
    """

    period: Fraction | int | None = IDLE_PERIOD
    inputs: Mapping[tuple[str, int | None], Handler] = {}
    observe: Callable[[Envelope], None] | None = None
    verdict: Verdict | None = None
    judged: Judged | None = None
    """What an evaluator records of what it judged, for the report."""
    finished: bool = False
    late_after: float | None = None
    """Microseconds after which an update that ends counts as late; None for half a period, and 10 ms at least."""
    arrived: int | None = None
    """When the message that is handled, or was last, arrived, in microseconds of test time."""
    paused: float = 0.0
    """Seconds for which what the service emulates has stood still so far, as the machine was too busy for it."""
    notes: Sequence[str] = ()
    """Sentences for the result of the test, which decide nothing."""
    drive: Callable[[Callable[[], bool]], None] | None = None
    """Runs instead of the loop, for the clock service. Takes a function that says whether to stop."""

    def begin(self, now: int) -> None:
        """All services are ready: the test begins."""

    def update(self, now: int) -> Iterable[Message | Output | Envelope | list[Framed]]:
        """Messages to send at ``now``, which is their sample time; envelopes are sent unchanged, lists fastest."""
        return ()

    def end_of_input(self, now: int) -> None:
        """A source has ended: evaluators decide."""

    def not_shown(self, message: Any, due: int) -> None:
        """A player could not show the frame of a ``dodo.NotShown``."""

    def record(self) -> None:
        """The service ends, with a verdict or without: complete what is in ``judged``."""


@dataclass
class Context:
    """What a service is built from; shared memory created here is removed at the end."""

    name: str
    flags: Flags
    messages: MessageSet
    resources: ExitStack = field(default_factory=ExitStack)
    clock: Clock = field(default_factory=RealTimeClock)
    session: Session | None = None
    """The bus itself: what a service has to hear of it. Only one with ``drive`` uses it for more."""
    on_rig: bool = False
    """Whether the test runs on a rig, where a service that vanishes may have been unplugged."""

    @property
    def log(self) -> logging.Logger:
        return logging.getLogger(self.name)

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory of ``size`` bytes; raises SharedMemoryError."""
        return self.resources.enter_context(self.clock.memory(name, size))


Build = Callable[[Context], Service]


def period_of(freq: float) -> Fraction | int:
    """The period in microseconds of a rate in Hz, exactly: steps at 60 and at 30 Hz stay aligned."""
    period = max(Fraction(1), MICROSECONDS / Fraction(freq).limit_denominator(MICROSECONDS))
    return period.numerator if period.denominator == 1 else period
