"""What the clock's modules share: the participants of a test, the link to them, and how a test can end."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from services.base.lockstep.datagrams import EncodedEnvelope
from services.clock.exchange import StepCommand, StepResult

SLICE_S = 0.05
"""How often the clock checks whether it has to stop."""


class TestEnded(Exception):
    """The test cannot go on; one sentence. ``kind`` names the reason in the protocol."""

    kind = ""


class ApplicationSilent(TestEnded):
    """The application did not answer in time."""

    kind = "unanswered"


class ApplicationFloods(TestEnded):
    """The application sends far more than it is asked for."""

    kind = "unanswered"


class ServiceSilent(TestEnded):
    """A service of the test does not answer the clock."""

    kind = "stuck"


class TimeOver(TestEnded):
    """The test time is over."""

    kind = "timedout"


class ServiceLink(Protocol):
    """Commands to the services and their results, as Exchange implements it."""

    def send(self, commands: Iterable[StepCommand]) -> None: ...
    def result(self, service: str) -> StepResult | None: ...
    def clear(self) -> None: ...
    def pump(self, timeout: float, bus: bool = True) -> None: ...
    def repeat_on_bus(self, messages: Iterable[EncodedEnvelope]) -> None: ...
    def drain(self) -> None: ...


IsStopped = Callable[[], bool]
"""Whether the clock has to stop."""


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` step in order, ``judge`` and ``watch`` beside them."""

    advance: tuple[str, ...]
    sense: tuple[str, ...]
    judge: tuple[str, ...]
    watch: tuple[str, ...] = ()

    @property
    def all(self) -> tuple[str, ...]:
        return (*self.advance, *self.sense, *self.judge, *self.watch)


@dataclass
class Patience:
    """Wall time in s that the application has for the first frame, and for each other one.

    What it waited for a processor meanwhile does not count: others are to blame for that.
    """

    first: float
    others: float


@dataclass(frozen=True)
class Timing:
    """``period`` and ``timeout`` in us of test time; answers are counted that take longer than ``max_response`` s."""

    period: Fraction | int
    timeout: int
    patience: Patience
    max_response: float | None = None
