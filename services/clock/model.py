"""The order of a step: the action layer advances, the environment senses, the application answers, evaluators look."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep import EPOCH
from services.base.parts import Said, say
from services.clock.answers import Answers
from services.clock.exchange import Done, Order

SERVICE_PATIENCE = 60.0
"""Wall time in s that a service of the test has for a step; none takes nearly as long."""


class Unanswered(Exception):
    """The application did not answer in time; one sentence."""


class Stuck(Exception):
    """A service of the test does not answer the clock; one sentence."""


class TimedOut(Exception):
    """The test time is over."""


class Talk(Protocol):
    """How orders get to the services: an Exchange, or a test's own."""

    def run(self, orders: Sequence[Order], deadline: float) -> list[Done]: ...
    def pump(self, timeout: float) -> None: ...


@dataclass(frozen=True)
class Roles:
    """The services of a test: ``advance`` and ``sense`` go one after the other, ``judge`` and ``watch`` all at once."""

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
    """Steps a test; ``period`` and ``timeout`` in us of test time."""

    roles: Roles
    period: int
    timeout: int
    patience: Patience
    answers: Answers
    talk: Talk
    stopped: Callable[[], bool]
    frames: int = 0
    now: int = EPOCH
    _backlog: dict[str, list[Said]] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _next: dict[str, int] = field(default_factory=dict)
    _memories: int = 0

    def __post_init__(self) -> None:
        self._backlog = {name: [] for name in self.roles.all}

    def meet(self) -> None:
        """Find all services, before time begins; raises Stuck."""
        dones = self._go([(name, EPOCH - 1) for name in self.roles.all])
        self._memories = sum(done.memories for done in dones)

    def run(self, begin: Envelope) -> None:
        """Until all evaluators have ended; raises Unanswered, Stuck and TimedOut."""
        self._spread([say(begin)], "")
        before = self.now - 1
        while not self.stopped():
            shown: list[Done] = []
            for together in self._order(before):
                dones = self._go(together)
                if set(self.roles.judge) <= self._ended or self.stopped():
                    return
                shown += [done for done in dones if done.pictures]
            if self.now - EPOCH > self.timeout:
                raise TimedOut
            if shown or not self._memories:
                self._see(shown)
            self._spread([say(envelope) for envelope in self.answers.collect()], "")
            before, self.now = self.now, self._following()

    def _order(self, before: int) -> Iterator[list[tuple[str, int]]]:
        """Who goes on together, and to when: services that hear one another go one after the other.

        Those that look at the step before do so beside the others: watchers first, as the last judge ends the test.
        """
        hops = [[(name, self.now)] for name in (*self.roles.advance, *self.roles.sense)]
        watchers, judges = ([(name, before) for name in names] for names in (self.roles.watch, self.roles.judge))
        if len(hops) < 2:
            hops.insert(0, [])
        hops[0] += watchers
        hops[1:1] = [] if len(hops) > 1 else [[]]
        hops[1] += judges
        yield from hops

    def _go(self, wanted: Iterable[tuple[str, int]]) -> list[Done]:
        orders = [Order(name, until, self._heard(name, until)) for name, until in wanted if name not in self._ended]
        if not orders:
            return []
        dones = self.talk.run(orders, time.monotonic() + SERVICE_PATIENCE)
        if len(dones) < len(orders) and not self.stopped():
            late = min({order.service for order in orders} - {done.service for done in dones})
            raise Stuck(f"service '{late}' did not answer the clock within {SERVICE_PATIENCE:g} s")
        for done in dones:
            self._spread(done.sent, done.service)
            self._next[done.service] = done.next
            if done.ended:
                self._ended.add(done.service)
        return dones

    def _heard(self, name: str, until: int) -> tuple[Said, ...]:
        """What a service has not heard yet, up to the time that it goes on to."""
        backlog = self._backlog[name]
        later = [said for said in backlog if until < said.envelope.sample_time <= self.now]
        self._backlog[name] = later
        return tuple(said for said in backlog if said not in later) if later else tuple(backlog)

    def _spread(self, said: Sequence[Said], sender: str) -> None:
        """What one said, all others will hear with their next step."""
        for name, backlog in self._backlog.items():
            if name != sender and name not in self._ended:
                backlog.extend(said)

    def _see(self, shown: Sequence[Done]) -> None:
        """The application sees the new pictures, and answers."""
        self.frames += 1
        patience = self.patience.first if self.frames == 1 else self.patience.others
        deadline = time.monotonic() + patience
        if not shown:
            self.answers.open(self.now)
        for camera in shown:
            self._show(camera, deadline, patience)
        if not self.answers.asked:
            for camera in shown:
                self._show(camera, deadline, patience)  # the readers wait again: they have done what they do
        while not self.answers.complete and not self.stopped():
            left = deadline - time.monotonic()
            if left <= 0:
                missing = " and ".join(name.rpartition(".")[2] for name in self.answers.missing)
                raise Unanswered(self._sentence(patience, f"{missing} missing"))
            self.talk.pump(left)

    def _show(self, camera: Done, deadline: float, patience: float) -> None:
        """Its readers are told of the picture as soon as they wait for it."""
        dones = self.talk.run([Order(camera.service, self.now, (), show=True)], deadline)
        if not dones and not self.stopped():
            raise Unanswered(self._sentence(patience, f"nobody waited for a picture of '{camera.service}'"))
        self.answers.open(camera.sampled)

    def _sentence(self, patience: float, what: str) -> str:
        return f"the application did not answer frame {self.frames} within {patience:g} s ({what})"

    def _following(self) -> int:
        """The time of the next step: a period on, or when a source says that it goes on."""
        told = [time for name, time in self._next.items() if time > self.now and name not in self._ended]
        return min(told) if told else self.now + self.period
