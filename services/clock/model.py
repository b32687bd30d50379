"""The order of a step: the action layer advances, the environment senses, the application answers, evaluators look."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep import EPOCH
from services.clock.answers import Answers


class Unanswered(Exception):
    """The application did not answer in time; one sentence."""


class TimedOut(Exception):
    """The test time, or the wall time, is over."""


@dataclass(frozen=True)
class Done:
    """What a service says of a step: all that it sent, how many pictures it made, and whether that was its last."""

    service: str
    sent: tuple[Envelope, ...] = ()
    pictures: int = 0
    ended: bool = False
    next: int = 0


Order = tuple[Sequence[str], int]
"""Services, and the time of the test (us) that they are to go on to."""

Exchange = Callable[[Sequence[tuple[str, int, list[Envelope]]]], list[Done]]
"""Sends each service its time and what it has to hear, and waits for all of them; in the order of the orders."""


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` go one after the other, ``judge`` all at once."""

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


@dataclass
class Stepper:
    """Steps a test; ``period`` and ``timeout`` in us of test time. ``wait`` pumps the bus until something came."""

    roles: Roles
    period: int
    timeout: int
    patience: Patience
    answers: Answers
    exchange: Exchange
    wait: Callable[[float], None]
    frames: int = 0
    now: int = EPOCH
    _backlog: dict[str, list[Envelope]] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _next: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._backlog = {name: [] for name in self.roles.all}

    def run(self, begin: Envelope, stopped: Callable[[], bool]) -> None:
        """Until all evaluators have ended; raises Unanswered and TimedOut."""
        self._spread([begin], "")
        before = self.now
        while not stopped():
            looking = [] if before == self.now else [(name, before) for name in (*self.roles.judge, *self.roles.watch)]
            self._act(looking)
            if set(self.roles.judge) <= self._ended:
                return
            if self.now - EPOCH > self.timeout:
                raise TimedOut
            self.answers.open(self.now)
            pictures = sum(done.pictures for name in self.roles.sense for done in self._go([(name, self.now)]))
            if pictures or not self._sees:
                self.frames += 1
                self._await_answer(stopped)
            self._spread(self.answers.collect(), "")
            before, self.now = self.now, self._following()

    @property
    def _sees(self) -> bool:
        """Whether the test shows the application pictures at all."""
        return bool(self.roles.sense)

    def _act(self, looking: list[tuple[str, int]]) -> None:
        """The action layer goes on to now, service by service; those that look back do so beside the first."""
        first, rest = self.roles.advance[:1], self.roles.advance[1:]
        self._go([*((name, self.now) for name in first), *looking])
        for name in rest:
            self._go([(name, self.now)])

    def _go(self, orders: Iterable[tuple[str, int]]) -> list[Done]:
        wanted = [(name, until, self._heard(name)) for name, until in orders if name not in self._ended]
        dones = self.exchange(wanted) if wanted else []
        for done in dones:
            self._spread(done.sent, done.service)
            if done.ended:
                self._ended.add(done.service)
            self._next[done.service] = done.next
        return dones

    def _heard(self, name: str) -> list[Envelope]:
        heard, self._backlog[name] = self._backlog[name], []
        return heard

    def _spread(self, envelopes: Iterable[Envelope], sender: str) -> None:
        """What one said, all others will hear with their next step."""
        said = list(envelopes)
        for name, backlog in self._backlog.items():
            if name != sender and name not in self._ended:
                backlog.extend(said)

    def _await_answer(self, stopped: Callable[[], bool]) -> None:
        patience = self.patience.first if self.frames == 1 else self.patience.others
        deadline = time.monotonic() + patience
        while not self.answers.complete and not stopped():
            left = deadline - time.monotonic()
            if left <= 0:
                missing = " and ".join(name.rpartition(".")[2] for name in self.answers.missing)
                what = f" ({missing} missing)" if missing else ""
                raise Unanswered(f"the application did not answer frame {self.frames} within {patience:g} s{what}")
            self.wait(left)

    def _following(self) -> int:
        """The time of the next step: a period on, or when a source says that it goes on."""
        told = [time for name, time in self._next.items() if time > self.now and name not in self._ended]
        return min(told) if told else self.now + self.period
