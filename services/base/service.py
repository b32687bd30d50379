"""The interface of services: a model with inputs and a period, built from flags."""

import logging
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.bus.envelope import Envelope
from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory.shared_memory import SharedMemory
from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base.clock import MICROSECONDS, Clock, RealTimeClock
from services.base.flags import Flags
from services.base.judged import Judged
from services.base.verdict import Verdict

IDLE_PERIOD = 50_000

Handler = Callable[[Any, int], None]
"""Takes a message and its sample time in microseconds."""


class Output(NamedTuple):
    """A message to send with a sender stamp of its own, and a sample time (us) where it is not that of the update."""

    message: Message
    sender_stamp: int
    sample_time: int | None = None


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
    drive: Callable[[Callable[[], bool]], None] | None = None
    """Runs instead of the loop, for the clock service. Takes a function that says whether to stop."""

    def begin(self, now: int) -> None:
        """All services are ready: the test begins."""

    def update(self, now: int) -> Iterable[Message | Output | Envelope]:
        """Messages to send at ``now``, which is their sample time; envelopes are sent unchanged."""
        return ()

    def end_of_input(self, now: int) -> None:
        """A source has ended: evaluators decide."""

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
    """The bus itself; only for a service with ``drive``."""
    key: bytes = field(default=b"", repr=False)
    """The key of the test; empty where there is no runner."""
    on_rig: bool = False
    """Whether the test runs on a rig, where a service that vanishes may have been unplugged."""

    @property
    def log(self) -> logging.Logger:
        """The service's log, on stderr."""
        return logging.getLogger(self.name)

    def memory(self, name: str, size: int) -> SharedMemory:
        """New shared memory of ``size`` bytes; raises SharedMemoryError."""
        return self.resources.enter_context(self.clock.memory(name, size))


Build = Callable[[Context], Service]


def period_of(freq: float) -> Fraction:
    """The period in microseconds of a rate in Hz, exactly: steps at 60 and at 30 Hz stay aligned."""
    return max(Fraction(1), MICROSECONDS / Fraction(freq).limit_denominator(MICROSECONDS))
