"""The order of a step: the action layer advances, the environment senses, the application answers, evaluators look."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Protocol

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep import EPOCH
from services.base.parts import Said, say
from services.clock.answers import Answers
from services.clock.exchange import Done, Order

_SLICE = 0.05
_AGAIN = 0.5
SERVICE_PATIENCE = 60.0
"""Wall time in s that a service of the test has for a step; none takes nearly as long."""


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


@dataclass
class Stepper:
    """Steps a test; ``period`` and ``timeout`` in us of test time."""

    roles: Roles
    period: Fraction | int
    timeout: int
    patience: Patience
    answers: Answers
    talk: Talk
    stopped: Callable[[], bool]
    frames: int = 0
    now: int = EPOCH
    reached: int = EPOCH
    """The last step that the evaluators looked at."""
    _looking: list[str] = field(default_factory=list)
    _looked_at: int = EPOCH
    _backlog: dict[str, list[Said]] = field(default_factory=dict)
    _hears: dict[str, frozenset[int]] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _next: dict[str, int] = field(default_factory=dict)
    _exact: Fraction = Fraction(EPOCH)
    _memories: int = 0
    _reading: set[str] = field(default_factory=set)
    """Cameras whose readers do not wait for the next picture yet, where nothing else tells of an answer."""
    _first: list[Said] = field(default_factory=list)
    spent: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    """Wall time in s by whom it was waited for."""

    def __post_init__(self) -> None:
        self._backlog = {name: [] for name in self.roles.all}

    def meet(self) -> None:
        """Find all services and what they hear, before time begins; raises Stuck."""
        dones = self._go(self.roles.all, EPOCH - 1)
        self._memories = sum(done.memories for done in dones)
        self._hears = {done.service: done.hears for done in dones if done.hears}

    def run(self, begin: Envelope) -> None:
        """Until all evaluators have ended; raises Unanswered, Stuck and TimedOut."""
        self._spread([say(begin)], "")
        while not self.stopped():
            if not self._memories:
                self._hear_from_now_on()
            shown = [
                done
                for name in (*self.roles.advance, *self.roles.sense)
                for done in self._go((name,), self.now)
                if done.pictures
            ]
            if self._judged():
                return
            self._see(shown) if shown or not self._memories else self._look()
            if self.now - EPOCH >= self.timeout and not self._judged():
                raise TimedOut
            self._spread([say(envelope) for envelope in self.answers.collect()], "")
            self._go_on()

    def _look(self) -> None:
        """Watchers and judges look at this step, while others go on already."""
        self._looking = [name for name in (*self.roles.watch, *self.roles.judge) if name not in self._ended]
        self._looked_at = self.now
        self._ask(self._looking, self.now)

    def _judged(self) -> bool:
        """Whether all evaluators have ended with the last step that they looked at; waits for them."""
        looking, self._looking = self._looking, []
        if looking:
            self._await(looking)
            self.reached = self._looked_at
        return set(self.roles.judge) <= self._ended

    def _go(self, names: Sequence[str], until: int) -> list[Done]:
        """All of them go on to a time; raises Stuck."""
        wanted = [name for name in names if name not in self._ended]
        self._ask(wanted, until)
        return self._await(wanted)

    def _ask(self, names: Sequence[str], until: int) -> None:
        self.talk.ask([Order(name, until, self._heard(name)) for name in names])

    def _await(self, names: Sequence[str]) -> list[Done]:
        dones: list[Done] = []
        began = time.monotonic()
        for name in names:
            while (done := self.talk.answer(name)) is None:
                if self.stopped():
                    return dones
                if time.monotonic() - began > SERVICE_PATIENCE:
                    raise Stuck(f"service '{name}' did not answer the clock within {SERVICE_PATIENCE:g} s")
                self.talk.pump(_SLICE, bus=False)
            self._take(done)
            dones.append(done)
        self.spent[" and ".join(names)] += time.monotonic() - began
        return dones

    def _take(self, done: Done) -> None:
        if not self.frames:
            self._first.extend(done.sent)
        self._spread(done.sent, done.service)
        self._next[done.service] = done.next
        if done.ended:
            self._ended.add(done.service)

    def _heard(self, name: str) -> tuple[Said, ...]:
        """What a service has not heard yet."""
        heard, self._backlog[name] = self._backlog[name], []
        return tuple(heard)

    def _spread(self, said: Sequence[Said], sender: str) -> None:
        """What one said, others will hear with their next step."""
        for name, backlog in self._backlog.items():
            if name != sender and name not in self._ended:
                hears = self._hears.get(name)
                backlog.extend(s for s in said if hears is None or s.envelope.data_type in hears)

    def _hear_from_now_on(self) -> None:
        """An application that sees no pictures answers what the services of this step are about to say."""
        self.talk.drain()
        self.answers.expect([self.now])
        self.answers.seen()

    def _see(self, shown: Sequence[Done]) -> None:
        """The application sees the new pictures and answers."""
        self.frames += 1
        began = time.monotonic()
        patience = self.patience.first if self.frames == 1 else self.patience.others
        if shown:
            self._show(shown, began, patience)
        self._look()
        self._await_answer(began, patience)

    def _show(self, shown: Sequence[Done], began: float, patience: float) -> None:
        """Readers are told of pictures as soon as they wait for them."""
        again = began + _AGAIN
        self.answers.expect(camera.sampled for camera in shown)
        for camera in shown:
            self.talk.ask([Order(camera.service, self.now, (), show=True)])
            while self.talk.answer(camera.service) is None:
                if self.stopped():
                    return
                if time.monotonic() - began > patience:
                    self.talk.forget()
                    raise Unanswered(self._sentence(patience, f"nobody waited for a picture of '{camera.service}'"))
                self.talk.pump(_SLICE)
                again = self._say_again(again)
            self.answers.seen()
        if not self.answers.asked:
            self._reading = {camera.service for camera in shown}
            self.talk.ask([Order(camera.service, self.now, (), show=True) for camera in shown])

    def _say_again(self, again: float) -> float:
        """An application that starts late hears what was said before its first picture, as it would in real time."""
        if self.frames > 1 or time.monotonic() < again:
            return again
        self.talk.tell(self._first)
        return time.monotonic() + _AGAIN

    def _await_answer(self, began: float, patience: float) -> None:
        while not (self.stopped() or self._is_answered):
            left = began + patience - time.monotonic()
            if left <= 0:
                if self._judged():
                    return
                raise Unanswered(self._sentence(patience, self._missing))
            self.talk.pump(left)
        self.spent["the first answer" if self.frames == 1 else "the application"] += time.monotonic() - began

    @property
    def _is_answered(self) -> bool:
        """Whether all answers came; where none are known, whether the readers wait for the next picture."""
        if self.answers.asked:
            return self.answers.complete
        self._reading = {name for name in self._reading if self.talk.answer(name) is None}
        return not self._reading

    @property
    def _missing(self) -> str:
        if self.answers.asked:
            return " and ".join(name.rpartition(".")[2] for name in self.answers.missing) + " missing"
        return f"nobody waited for the next picture of '{min(self._reading)}'"

    def _sentence(self, patience: float, what: str) -> str:
        return f"the application did not answer frame {self.frames} within {patience:g} s ({what})"

    def _go_on(self) -> None:
        """To the time of the next step: a period on, or when a source says that it goes on."""
        told = [time for name, time in self._next.items() if time > self.now and name not in self._ended]
        self._exact = Fraction(min(told)) if told else self._exact + self.period
        self.now = round(self._exact)
