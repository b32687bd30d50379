"""The order of a step: the action layer advances, the environment senses, the application answers, evaluators look."""

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from dodo_dsl.opendlv.bus.envelope import Envelope
from services.base.lockstep.datagrams import Said, say
from services.base.lockstep.lockstep_clock import EPOCH
from services.clock.application import Audience
from services.clock.exchange import Done, Order
from services.clock.participants import SLICE_S, Roles, Stopped, Stuck, Talk, TimedOut, Unanswered

SERVICE_PATIENCE = 60.0
"""Wall time in s that a service of the test has for a step; none takes nearly as long."""


@dataclass
class Stepper:
    """Steps a test; ``period`` and ``timeout`` in us of test time."""

    roles: Roles
    period: Fraction | int
    timeout: int
    audience: Audience
    talk: Talk
    stopped: Stopped
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
    _spent: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))

    def __post_init__(self) -> None:
        self._backlog = {name: [] for name in self.roles.all}

    @property
    def spent(self) -> dict[str, float]:
        """Wall time in s by whom it was waited for."""
        application = {"the first answer": self.audience.waited_first, "the application": self.audience.waited}
        return {**self._spent, **application}

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
                self.audience.listens(self.now)
            shown = [
                done
                for name in (*self.roles.advance, *self.roles.sense)
                for done in self._go((name,), self.now)
                if done.pictures
            ]
            if self._judged():
                return
            is_asked = bool(shown) or not self._memories
            if is_asked:
                self.audience.show(shown, self.now)
            self._look()
            if is_asked and not self._is_answered():
                return
            if self.now - EPOCH >= self.timeout and not self._judged():
                raise TimedOut
            self._spread([say(envelope) for envelope in self.audience.collect()], "")
            self._go_on()

    def _look(self) -> None:
        """Watchers and judges look at this step, while others go on already."""
        self._looking = [name for name in (*self.roles.watch, *self.roles.judge) if name not in self._ended]
        self._looked_at = self.now
        self._ask(self._looking, self.now)

    def _is_answered(self) -> bool:
        """Waits for the answer; one that does not come is no matter when the test is over. Raises Unanswered."""
        try:
            self.audience.await_answer()
        except Unanswered:
            if not self._judged():
                raise
            return False
        return True

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
                self.talk.pump(SLICE_S, bus=False)
            self._take(done)
            dones.append(done)
        self._spent[" and ".join(names)] += time.monotonic() - began
        return dones

    def _take(self, done: Done) -> None:
        self.audience.missed(done.sent)
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

    def _go_on(self) -> None:
        """To the time of the next step: a period on, or when a source says that it goes on."""
        told = [time for name, time in self._next.items() if time > self.now and name not in self._ended]
        self._exact = Fraction(min(told)) if told else self._exact + self.period
        self.now = round(self._exact)
