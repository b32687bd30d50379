"""The order of a step: the action layer advances, the environment senses, the application answers, evaluators judge."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from dodo_dsl.opendlv.channel import Done, Step
from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep_clock import EPOCH
from services.clock.exchange import (
    SERVICE_PATIENCE,
    START_PATIENCE,
    ApplicationFails,
    ApplicationFloods,
    Exchange,
    Roles,
    TimeOver,
)

if TYPE_CHECKING:
    from services.clock.answers import AnsweringApplication
    from services.clock.resting import RestingApplication


@dataclass
class Stepper:
    """Steps a test; ``period`` and ``timeout`` in us of test time."""

    roles: Roles
    period: Fraction | int
    timeout: int
    application: "AnsweringApplication | RestingApplication"
    link: Exchange
    now: int = EPOCH
    reached: int = EPOCH
    """The last step that the evaluators have finished."""
    _judging: list[str] = field(default_factory=list)
    _watching: list[str] = field(default_factory=list)
    _judging_at: int = EPOCH
    _backlog: dict[str, list[Envelope]] = field(default_factory=dict)
    _consumed: dict[str, frozenset[int]] = field(default_factory=dict)
    _ended: set[str] = field(default_factory=set)
    _next: dict[str, int] = field(default_factory=dict)
    _exact: Fraction = Fraction(EPOCH)

    def takers(self, data_type: int) -> list[str]:
        return [name for name in self.roles.all if data_type in self._consumed.get(name, ())]

    def start(self) -> None:
        """Find all services and what they consume, then let the application start until it rests; raises TestEnded."""
        self.link.connect()
        self._backlog = {name: [] for name in self.roles.all}
        results = self._go(self.roles.all, EPOCH - 1)
        self._consumed = {r.service: frozenset(r.about.consumes) for r in results if r.about and r.about.consumes}
        self.application.start(self.now, {r.service for r in results if r.about and r.about.memories})

    def run(self, begin: Envelope) -> None:
        """Until all evaluators have ended; raises TestEnded."""
        self._deliver([begin._replace(sample_time=EPOCH, received=0)], "")
        while not self.link.stopped():
            self.application.begin_step(self.now)
            going = [done for name in (*self.roles.advance, *self.roles.sense) for done in self._go((name,), self.now)]
            if self._is_over():
                return
            self.application.show([result for result in going if result.pictures], self.now)
            self._judge()
            try:
                if not self._is_answered():
                    return
            finally:
                self._watch()
            if self.now - EPOCH >= self.timeout and not self._is_over():
                raise TimeOver
            self._deliver(self.application.collect(), "")
            self._go_on()

    def _judge(self) -> None:
        """Evaluators begin this step, while others go on already."""
        self._judging = [name for name in self.roles.judge if name not in self._ended]
        self._judging_at = self.now
        self._send(self._judging, self.now)

    def _watch(self) -> None:
        """Watchers begin this step: its pictures are there now, and stay until the next ones are shown."""
        self._watching = [name for name in self.roles.watch if name not in self._ended]
        self._send(self._watching, self.now)

    def _is_answered(self) -> bool:
        """Wait for the answer; a missing one does not matter when the test is over. Raises TestEnded."""
        try:
            self.application.await_answer(round(self._following()))
        except ApplicationFails as problem:
            if isinstance(problem, ApplicationFloods) or not self._is_over():
                raise
            return False
        return True

    def _is_over(self) -> bool:
        """Whether all evaluators have ended with the last step that they were given; waits for them and watchers."""
        watching, self._watching = self._watching, []
        self._await(watching)
        judging, self._judging = self._judging, []
        if judging:
            self._await(judging)
            self.reached = self._judging_at
        return set(self.roles.judge) <= self._ended

    def _go(self, names: Sequence[str], until: int) -> list[Done]:
        """Let services go on to a time (us); raises ServiceSilent."""
        running = [name for name in names if name not in self._ended]
        self._send(running, until)
        return self._await(running)

    def _send(self, names: Sequence[str], until: int) -> None:
        for name in names:
            messages, self._backlog[name] = self._backlog[name], []
            self.link.send(name, Step(until, messages))

    def _await(self, names: Sequence[str]) -> list[Done]:
        results = self.link.results(names, SERVICE_PATIENCE if self._next else START_PATIENCE)
        for result in results:
            self._take(result)
        return results

    def _take(self, result: Done) -> None:
        self._deliver(result.messages, result.service)
        self._next[result.service] = result.next
        if result.ended:
            self._ended.add(result.service)

    def _deliver(self, messages: Sequence[Envelope], sender: str) -> None:
        """Give messages of one service to the others with their next step."""
        for name, backlog in self._backlog.items():
            if name != sender and name not in self._ended:
                consumed = self._consumed.get(name)
                backlog.extend(m for m in messages if consumed is None or m.data_type in consumed)

    def _following(self) -> Fraction:
        """The time of the next step: a period later, or the earliest that a source announced."""
        announced = [time for name, time in self._next.items() if time > self.now and name not in self._ended]
        return Fraction(min(announced)) if announced else self._exact + self.period

    def _go_on(self) -> None:
        self._exact = self._following()
        self.now = round(self._exact)
