"""What the clock's parts have in common: who takes part in a test, how they are talked to, and how a test can end."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from services.base.lockstep.datagrams import Said
from services.clock.exchange import Done, Order

SLICE_S = 0.05
"""The clock looks this often whether it is to stop."""


class Unanswered(Exception):
    """The application did not answer in time; one sentence."""


class Stuck(Exception):
    """A service of the test does not answer the clock; one sentence."""


class TimedOut(Exception):
    """The test time is over."""


class Talk(Protocol):
    """How orders get to the services, as Exchange has it."""

    def ask(self, orders: Iterable[Order]) -> None: ...
    def answer(self, service: str) -> Done | None: ...
    def forget(self) -> None: ...
    def pump(self, timeout: float, bus: bool = True) -> None: ...
    def tell(self, said: Iterable[Said]) -> None: ...
    def drain(self) -> None: ...


Stopped = Callable[[], bool]
"""Whether the clock was told to stop."""


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` go one after the other, ``judge`` and ``watch`` beside them."""

    advance: tuple[str, ...]
    sense: tuple[str, ...]
    judge: tuple[str, ...]
    watch: tuple[str, ...] = ()

    @property
    def all(self) -> tuple[str, ...]:
        return (*self.advance, *self.sense, *self.judge, *self.watch)


@dataclass
class Patience:
    """Wall time in s that the application has for the first frame, and for each other one."""

    first: float
    others: float
