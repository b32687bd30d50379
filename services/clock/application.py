"""The application under test as the clock sees it: it gets pictures and answers them.

How long it takes for an answer is measured: lockstep hides that, as the world waits for it. So is whether it goes on
by its own clock while the world waits.
"""

import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.channel import Done, Show
from dodo_dsl.opendlv.envelope import Envelope
from services.base.loop import others
from services.clock.answers import MOST_SURPLUS, Answers
from services.clock.exchange import (
    SLICE_S,
    ApplicationFloods,
    ApplicationSilent,
    IsStopped,
    Patience,
    ServiceLink,
)
from services.clock.processor_time import NOTHING, ApplicationProcesses, Spent, contention_s, own_wait_s

_FIRST_FRAME = 2
"""The one of the first answer that counts."""


@dataclass
class ResponseTimes:
    """The answers of a test, without the first, for which programs load their libraries; times in s.

    An answer's time is the wall time from the frame to the answer less what the application, or the clock itself,
    waited for a processor, and at least the processor time that it took, up to the wall time. ``limit_s`` is the
    longest that an answer may take, ``period_s`` the period of the frames.
    """

    period_s: float = 0.1
    limit_s: float | None = None
    uncopied: int = 0
    """Answers that did not carry the sample time of their frame."""
    _taken: list[float] = field(default_factory=list)
    _processor: list[float] = field(default_factory=list)

    def add(self, wall_s: float, spent: Spent | None, is_copied: bool = True) -> None:
        """One more answer; ``spent`` is None if the application's processes cannot be seen."""
        self.uncopied += not is_copied
        if spent is None:
            self._taken.append(wall_s)
            return
        self._processor.append(spent.ran_s)
        self._taken.append(max(wall_s - spent.waited_s, min(spent.ran_s, wall_s), 0.0))

    def facts(self) -> dict[str, Any]:
        """What the clock reports: numbers in s, none without an answer; ``over`` counts answers beyond the limit."""
        if not self._taken:
            return {}
        return {
            "answers": len(self._taken),
            "period_s": self.period_s,
            "median_s": statistics.median(self._taken),
            "p95_s": _percentile(self._taken, 0.95),
            "worst_s": max(self._taken),
            "processor_median_s": statistics.median(self._processor) if self._processor else None,
            "processor_p95_s": _percentile(self._processor, 0.95) if self._processor else None,
            "processor_worst_s": max(self._processor, default=None),
            "slow": sum(taken > self.period_s for taken in self._taken),
            "worst_frame": self._taken.index(max(self._taken)) + _FIRST_FRAME,
            "uncopied": self.uncopied,
            "over": None if self.limit_s is None else sum(taken > self.limit_s for taken in self._taken),
            "processor": processor_name(),
        }


def _percentile(values: Sequence[float], share: float) -> float:
    """The smallest value that at least this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, max(0, -int(-share * len(ordered) // 1) - 1))]


def processor_name(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """The processor as Linux names it, with its clock where it says one; empty if it says nothing."""
    try:
        lines = cpuinfo.read_text(errors="replace").splitlines()
    except OSError:
        return ""
    facts = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in reversed(lines))}
    name = facts.get("model name") or facts.get("Model") or facts.get("Hardware") or ""
    clock = facts.get("cpu MHz", "")
    return f"{name}, {float(clock):.0f} MHz" if name and clock.replace(".", "", 1).isdigit() else name


_AGAIN_S = 0.5
_FIRST_PAUSE, _NEXT_PAUSE = 3, 8
"""The frame after whose answer the first pause is, and how many times as late each next one."""
_LEAST_PAUSE_S, _MOST_PAUSE_S = 0.025, 1.0
MOST_CONTENTION_S = 20.0
"""Most seconds for which an application has longer as the machine is busy, where its processes cannot be seen."""


class SteppedApplication:
    """Shows pictures to the application and waits for its answers; ``frames`` counts what was shown."""

    has_own_time = False

    def __init__(
        self,
        answers: Answers,
        patience: Patience,
        link: ServiceLink,
        stopped: IsStopped,
        response: ResponseTimes,
    ) -> None:
        self.answers = answers
        self.frames = 0
        self.waited_first, self.waited = 0.0, 0.0
        """Wall time in s for the first answer, and for all others."""
        self.response = response
        self.processes = ApplicationProcesses(())
        """To be set when they are known."""
        self._patience, self._link, self._stopped = patience, link, stopped
        self._began, self._before, self._own_before = 0.0, NOTHING, 0.0
        self._contention_before = 0.0
        self._shown, self._own_wait = 0.0, 0.0
        """When all pictures were there, and how long the clock itself had waited for a processor until then."""
        self.pauses, self.unasked = 0, 0
        """Pauses in which nothing was shown, and those in which the application sent on all the same."""
        self._pause_after, self._answered = _FIRST_PAUSE, 0.0
        self._gaps: list[float] = []
        """Times in s from one answer to the next."""
        self._first: list[Envelope] = []
        self._reading: set[str] = set()
        """Cameras whose readers do not wait for the next picture yet, where no message completes a frame."""

    def begin(self, now: int) -> None:
        """It may still be starting: the first picture waits for it."""

    def expect_at(self, now: int) -> None:
        """Without cameras, the application answers the services' messages in the step of this time (us)."""
        self._link.drain()
        self.answers.expect([now])
        self.answers.seen()

    def remember(self, messages: Iterable[Envelope]) -> None:
        """Services have sent this; before the first picture the application may not be there yet."""
        if not self.frames:
            self._first.extend(messages)

    def show(self, shown: Sequence[Done], now: int) -> None:
        """Announce new pictures as soon as readers wait for them; raises ApplicationSilent and ApplicationFloods."""
        self.frames += 1
        self._began, self._before, self._own_before = time.monotonic(), self.processes.snapshot(), own_wait_s()
        self._contention_before = 0.0 if self.processes else contention_s()
        again = self._began + _AGAIN_S
        if shown:
            self.answers.expect(camera.sampled for camera in shown)
        for camera in shown:
            if not camera.awaited:
                self._link.send(camera.service, Show(awaits=True, announces=False))
            while not camera.awaited and self._link.result(camera.service) is None:
                if self._stopped():
                    return
                if self._left <= 0:
                    raise ApplicationSilent(self._sentence(f"no reader waited for a picture of '{camera.service}'"))
                self._link.pump(SLICE_S, [camera.service])
                self._check_flood()
                again = self._repeat_first(again)
            self._link.drain()  # what the application has sent before it can see the picture
            self.answers.seen()
            self._link.send(camera.service, Show(awaits=False, announces=True))
            while len(shown) > 1 and self._link.result(camera.service) is None and not self._stopped():
                self._link.pump(SLICE_S, [camera.service])  # pictures are shown in one order
        if not self.answers.is_expected:
            self._reading = {camera.service for camera in shown}
            for camera in shown:
                self._link.send(camera.service, Show(awaits=True, announces=False))
        self._shown, self._own_wait = time.monotonic(), own_wait_s()

    def await_answer(self, until: int = 0) -> None:
        """Wait for the answer to what was shown, whenever (``until``) the next step is.

        Raises ApplicationSilent and ApplicationFloods.
        """
        while not (self._stopped() or self._is_answered):
            if self._left <= 0:
                raise ApplicationSilent(self._sentence(self._missing), silent=self.answers.is_silent)
            self._link.pump(self._left, self._reading)
            self._check_flood()
        before, self._answered = self._answered, time.monotonic()
        spent = self._answered - self._began
        if before:
            self._gaps.append(self._answered - before)
        if self.frames == 1:
            self.waited_first += spent
        else:
            self.waited += spent
            taken, own, ran = time.monotonic() - self._shown, own_wait_s() - self._own_wait, None
            if self.processes:
                now = self.processes.snapshot()
                own = now.by_others(self._before, own)
                ran = now.since(self._before, own)
            self.response.add(max(taken - own, 0.0), ran, self.answers.is_copied)

    def pause(self) -> None:
        """Show nothing for a while, now and then: what the application sends by timers, it sends all the same.

        No timer by which it sends is slower than its answers follow each other, so that it comes to pass within that
        time. Messages that follow an answer at once are of that answer, and late ones do not come in two such times.
        """
        if self.frames != self._pause_after:
            return
        self._pause_after *= _NEXT_PAUSE
        length = min(max(statistics.median(self._gaps), _LEAST_PAUSE_S), _MOST_PAUSE_S)
        self._listen(self._answered + length / 2)
        self.pauses += 1
        self.unasked += all(self._listen(time.monotonic() + length) for _ in range(2))

    def _listen(self, until: float) -> bool:
        """Whether any message that matters comes until then."""
        before = self.answers.heard
        while not self._stopped() and (left := until - time.monotonic()) > 0:
            self._link.pump(left)
        self._link.drain()
        return self.answers.heard > before

    def facts(self) -> dict[str, Any]:
        """What the clock reports of the answers, as ``ResponseTimes.facts``."""
        facts, answers = self.response.facts(), self.answers
        counts = {name: getattr(answers, name) for name in ("surplus", "surplus_frames", "differing")}
        return facts and {**facts, **counts, "pauses": self.pauses, "unasked": self.unasked}

    def collect(self) -> list[Envelope]:
        """The application's messages since the last time, for the services."""
        return self.answers.collect()

    def _check_flood(self) -> None:
        message = self.answers.flood.rpartition(".")[2]
        if message:
            sent = f"sent more than {MOST_SURPLUS} {message}s that nobody asked for"
            raise ApplicationFloods(f"the application {sent} within frame {self.frames}: it floods the bus")

    @property
    def _limit(self) -> float:
        return self._patience.first if self.frames == 1 else self._patience.others

    @property
    def _left(self) -> float:
        """Seconds of patience; what the application, or the clock, waited for a processor does not count.

        Of an application in containers it is not known: there, up to MOST_CONTENTION_S do not count in which anything
        on the machine waited.
        """
        left = self._began + self._limit - time.monotonic()
        return left if left > 0 else left + self._starved

    @property
    def _starved(self) -> float:
        own = own_wait_s() - self._own_before
        if self.processes:
            now = self.processes.snapshot()
            return max(now.longest_wait(self._before), now.by_others(self._before, own))
        return max(min(contention_s() - self._contention_before, MOST_CONTENTION_S), own)

    def _repeat_first(self, again: float) -> float:
        """An application that starts late gets what was sent before its first picture, as in real time."""
        if self.frames > 1 or time.monotonic() < again:
            return again
        self._link.repeat_on_bus(self._first)
        return time.monotonic() + _AGAIN_S

    @property
    def _is_answered(self) -> bool:
        """Whether all answers came; where none are declared, whether the readers wait for the next picture."""
        if self.answers.is_expected:
            return self.answers.is_complete
        self._reading = {name for name in self._reading if self._link.result(name) is None}
        return not self._reading

    @property
    def _missing(self) -> str:
        if self.answers.is_expected:
            missing = " and ".join(name.rpartition(".")[2] for name in self.answers.missing) + " missing"
            strangers = self.answers.strangers
            return f"{missing}, but {others(strangers)} came" if strangers else missing
        return f"no reader waited for the next picture of '{min(self._reading)}'"

    def _sentence(self, what: str) -> str:
        return f"the application did not answer frame {self.frames} within {self._limit:g} s ({what})"
