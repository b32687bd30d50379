"""The base of all evaluators: when a test is over, and the one verdict that follows."""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable
from typing import Any, NamedTuple

from google.protobuf.message import Message

from dodo_dsl.opendlv.envelope import Envelope
from services.base.clock import MICROSECONDS
from services.base.judged import Judged
from services.base.service import Output, Service, Verdict

EARLY = MICROSECONDS // 10
"""How much later than its arrival the time of a sample may be, in us, as clocks differ: nobody answers the future."""


class UnjudgeableError(Exception):
    """There is nothing to judge the application by: the test itself is at fault."""


class JudgedTime(NamedTuple):
    """The time that was observed, as it reads in a reason."""

    within: str
    """What happened ``within 40.00 s``, or ``before the input ended after 12.50 s``."""
    throughout: str
    """What stayed so ``for 40.00 s``, or ``until the input ended after 12.50 s``."""
    is_complete: bool = False
    """Whether the input ended, rather than the time of the test."""


class Hidden(list[int]):
    """Times in us at which nothing was shown that could be answered: where they begin and end, in turn, ascending."""

    def hide(self, begin: int, end: int) -> None:
        """From a frame that could not be shown to the next one; both come after those before."""
        if self and begin <= self[-1]:
            self[-1] = max(end, self[-1])
        else:
            self += begin, end

    def hides(self, time: int) -> bool:
        return bisect_right(self, time) % 2 == 1

    def shown(self, time: int) -> int:
        """The time on a clock that stands still while nothing is shown."""
        pairs = zip(self[::2], self[1::2], strict=True)
        return time - sum(min(end, time) - begin for begin, end in pairs if begin < time)


class Evaluator(Service, ABC):
    """Judges in test time (microseconds) and gives its verdict at the latest when time or input are over.

    Time zero is the first of ``begin``, ``update`` and whatever else looks at ``elapsed``; ``begin`` counts once and
    overrides the others. Subclasses take their messages in ``inputs`` and decide in ``decide``, or before by setting
    ``verdict``; each of them may raise UnjudgeableError. What they put into ``judged`` the report draws over time.
    """

    judged: Judged

    def __init__(self, max_time: float, max_delay: float = 0.0) -> None:
        """``max_time`` in s after time zero; ``max_delay`` in s in which answers may follow the end of the input."""
        self.now: int | None = None
        self.judged = Judged()
        self.hidden, self.hidden_samples = Hidden(), Hidden()
        """When a player of the test could not show frames, in the test's time and in that of their samples."""
        self._max_time, self._max_delay = max_time, max_delay
        self._zero: int | None = None
        self._ended: int | None = None
        self._has_begun = False

    @property
    def zero(self) -> int:
        """Time zero; 0 while it is not known."""
        return self._zero or 0

    @property
    def arrival(self) -> int | None:
        """When the message that is handled arrived, in us; None while no time is known."""
        return self.now if self.arrived is None else self.arrived

    def begin(self, now: int) -> None:
        if not self._has_begun:
            self._has_begun, self._zero = True, now
            self.judged.clear()
            self.forget(now)

    def update(self, now: int) -> Iterable[Message | Output | Envelope]:
        self.now = now
        self.elapsed(now)
        if self.verdict is None:
            self.advance(now)
            self._check_time(now)
        return ()

    def end_of_input(self, now: int) -> None:
        if self._ended is None and self.verdict is None:
            self._ended = self.now = now
            self.elapsed(now)
            self._check_time(now)

    def not_shown(self, message: Any, due: int) -> None:
        self.hidden.hide(due, message.dueUntil)
        self.hidden_samples.hide(message.sampled, message.sampledUntil)

    def elapsed(self, time: int) -> float:
        """Seconds since time zero, which is now if it was not known before; negative before it."""
        if self._zero is None:
            self._zero = time
        return (time - self._zero) / MICROSECONDS

    def is_overdue(self, time: int) -> bool:
        return self.elapsed(time) > self._max_time

    def conclude(self, span: JudgedTime) -> None:
        if self.verdict is None:
            self.verdict = self.decide(span)

    def time_is_over(self) -> None:
        seconds = f"{self._max_time:.2f} s"
        self.conclude(JudgedTime(f"within {seconds}", f"for {seconds}"))

    def forget(self, now: int) -> None:
        """The test begins: what was measured before it does not count."""

    def advance(self, now: int) -> None:
        """An update before the verdict."""

    @abstractmethod
    def decide(self, span: JudgedTime) -> Verdict:
        """The verdict on what was observed in a span."""

    def _check_time(self, now: int) -> None:
        if self._ended is None:
            if self.is_overdue(now):
                self.time_is_over()
        elif now - self._ended >= self._max_delay * MICROSECONDS:
            over = f"the input ended after {self.elapsed(self._ended):.2f} s"
            self.conclude(JudgedTime(f"before {over}", f"until {over}", is_complete=True))
