"""The application whose own time is the test's: the agent lets it run up to a time, and says when it rests."""

import math
import re
import statistics
import time
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv.channel import Done, Show
from dodo_dsl.opendlv.envelope import Envelope
from services.base.runner import tell
from services.clock import exchange
from services.clock.agent import Busy, Report, TimeAgent
from services.clock.answers import MessageFilter
from services.clock.exchange import SLICE_S, WALL_FACTOR, ApplicationFails, ApplicationFloods, Exchange, ServiceSilent
from services.clock.printed_lines import PrintedLines

MOST_SENT = 1000
"""Messages of one kind in a step; more of them are a flood."""
PATIENCE_S = 60.0
"""Wall time in s for an application that goes on without reaching the time."""
EXPOSED_US = 1
"""How long after its sample time a picture is shown, so that the time of now is none of a picture."""
GONE_S = 1.0
"""Wall time in s that the runner has to end a test of which a service has ended."""
LOOK_US = 10_000
"""Test time between looks whether an application waits for its first picture."""
_NS = 1000
_MOST_NOTES = 64


@dataclass
class ResponseTimes:
    """What the application computed for its answers, without the first, for which programs load their libraries.

    ``limit_s`` is the longest that an answer may take, ``period_s`` the period of the frames.
    """

    period_s: float = 0.1
    limit_s: float | None = None
    _answers: list[tuple[float, int, bool]] = field(default_factory=list)

    def add(self, frame: int, taken_s: float, *, is_copied: bool = True) -> None:
        """An answer to a frame, whether it carried the sample time of that."""
        self._answers.append((taken_s, frame, is_copied))

    def facts(self) -> dict[str, Any]:
        """What the clock reports: numbers in s, none without an answer; ``over`` counts answers beyond the limit."""
        answers = self._answers[1:]
        if not answers:
            return {}
        taken = sorted(taken_s for taken_s, _, _ in answers)
        return {
            "answers": len(taken),
            "period_s": self.period_s,
            "median_s": statistics.median(taken),
            "p95_s": taken[math.ceil(0.95 * len(taken)) - 1],
            "worst_s": taken[-1],
            "slow": sum(each > self.period_s for each in taken),
            "worst_frame": max(answers, key=itemgetter(0))[1],
            "over": None if self.limit_s is None else sum(each > self.limit_s for each in taken),
            "uncopied": sum(not is_copied for _, _, is_copied in answers),
            "processor": processor_name(),
        }


def processor_name() -> str:
    """The processor as Linux names it; empty if it says nothing."""
    try:
        text = Path("/proc/cpuinfo").read_text(errors="replace")
    except OSError:
        return ""
    found = (
        re.search(rf"^{key}[ \t]*:[ \t]*(\S.*)$", text, re.MULTILINE) for key in ("model name", "Model", "Hardware")
    )
    return next((each[1] for each in found if each), "")


@dataclass
class RestingApplication:
    """Lets the application go on from step to step, and shows pictures when they are due; ``frames`` counts steps.

    It collects all that the application sends and services consume, by ``filters``, under any sender stamp, as they
    count those. ``names`` are those of its services; its ``lines`` are messages.
    """

    link: Exchange
    filters: Sequence[MessageFilter]
    agent: TimeAgent
    response: ResponseTimes
    names: Sequence[str] = ()
    lines: PrintedLines | None = None
    frames: int = 0
    _sampled: set[int] = field(default_factory=set)
    """Sample times of the frames that were shown last."""
    _sent: list[Envelope] = field(default_factory=list)
    _counts: Counter[int] = field(default_factory=Counter)
    _noted: set[str] = field(default_factory=set)
    _unread: set[str] = field(default_factory=set)
    """Cameras whose pictures nobody has waited for yet."""
    _held: list[str] = field(default_factory=list)
    """Cameras with a picture that is to be shown."""
    _shown_at: int = 0
    _until: int = 0
    _taken_s: float = 0.0
    _gone: frozenset[int] = frozenset()

    def facts(self) -> dict[str, Any]:
        for camera in sorted(self._unread if self.frames else ()):
            self._note_once(f"no program of the application waited for a frame of '{camera}'")
        return self.response.facts()

    def start(self, now: int, cameras: Collection[str]) -> None:
        """Let it start at a time (us), until it rests; raises TestEnded."""
        self._unread = {*cameras}
        self._shown_at = now
        self._run(now)

    def begin_step(self, now: int) -> None:
        """What it sends counts at its own time, whatever services send."""

    def show(self, shown: Sequence[Done], now: int) -> None:
        """Let it take what services have sent by ``now`` (us), then show it new pictures, whether it waits or not.

        The first picture of a camera is shown as soon as it waits for one. Raises TestEnded.
        """
        self.frames += 1
        self._shown_at, self._taken_s = now, 0.0
        self._run(now + EXPOSED_US)
        if shown:
            self._sampled = {camera.sampled for camera in shown}
        self._held = [camera.service for camera in shown]
        self._announce()

    def _announce(self) -> None:
        """Show the pictures, but the first one of a camera only when it is awaited."""
        asked = [camera for camera in self._held if camera in self._unread]
        awaited = [done.service for done in self._go(asked, Show(awaits=False, announces=False)) if done.awaited]
        self._unread.difference_update(awaited)
        self._go([camera for camera in self._held if camera not in self._unread], Show(awaits=False, announces=True))
        self._held = [camera for camera in self._held if camera in self._unread]

    def _go(self, cameras: Sequence[str], command: Show) -> list[Done]:
        for camera in cameras:
            self.link.send(camera, command)
        return self.link.results(cameras)

    def await_answer(self, until: int) -> None:
        """Let it go on to ``until`` (us); raises TestEnded."""
        self._until, now = until, self._shown_at
        while self._held and (now := now + LOOK_US) < until and not self.link.stopped():
            self._run(now)
            self._announce()
        self._run(until)

    def take(self, envelope: Envelope) -> None:
        """Take a message from the bus; raises ApplicationFails."""
        name = next((each.name for each in self.filters if each.data_type == envelope.data_type), "")
        if not name:
            return
        self._counts[envelope.data_type] += 1
        if self._counts[envelope.data_type] > MOST_SENT:
            message = name.partition("/")[0].rpartition(".")[2]
            raise ApplicationFloods(
                f"the application sent more than {MOST_SENT} {message}s within a step: it floods the bus"
            )
        self._sent.append(envelope)

    def collect(self) -> list[Envelope]:
        """The application's messages since the last time, for the services, in the order in which they were sent.

        They count from the next microsecond on, so that it acts on no update of the time at which it sent them.
        """
        sent, self._sent = self._sent, []
        self._counts.clear()
        own = [envelope for envelope in sent if any(each.matches(envelope) for each in self.filters)]
        if own or not self.filters:
            is_copied = all(envelope.sample_time in self._sampled for envelope in own)
            self.response.add(self.frames, self._taken_s, is_copied=is_copied)
        begin, end = self._shown_at, self._until
        return [envelope._replace(received=min(max(envelope.sent, begin) + 1, end)) for envelope in sent]

    def _run(self, until: int) -> None:
        began = time.monotonic()
        self.agent.run(until)
        while not self.link.stopped():
            report = self.agent.report(SLICE_S)
            self.link.drain()
            if report is not None and self._has_reached(report, until, began):
                break
            if time.monotonic() - began > max(PATIENCE_S, WALL_FACTOR * self._limit):
                raise ApplicationFails(
                    f"the application did not come to {(until - self._shown_at) / 1e6:g} s "
                    f"of its own time within {time.monotonic() - began:.0f} s of wall time"
                )

    def _has_reached(self, report: Report, until: int, began: float) -> bool:
        """Whether it rests at this time; raises TestEnded."""
        if report.destroyed:
            raise ApplicationFails("the application destroyed the page that gives it the test's time")
        if report.busy is not None:
            self._refuse_busy(report.busy)
        if report.now is None:
            return False
        self._tell(report)
        self._await_runner(report.gone)
        spent_s = time.monotonic() - began
        self._taken_s += spent_s if report.has_ended else min(report.ran_s, spent_s)
        if report.now < until * _NS:
            return False
        if not (has_lines := self._has_lines(until)):
            self.agent.run(until)
        return has_lines

    def _await_runner(self, gone: frozenset[int]) -> None:
        """Where a service has ended, the runner says whether the test goes on, before more of it passes."""
        end = time.monotonic() + GONE_S * bool(gone - self._gone)
        self._gone |= gone
        while time.monotonic() < end and not self.link.stopped():
            time.sleep(SLICE_S)

    def _has_lines(self, until: int) -> bool:
        """Whether all that it has printed in this step is taken, and it still rests."""
        is_shown_next = self.frames > 0 and until in (self._shown_at, self._shown_at + EXPOSED_US)
        return is_shown_next or self.lines is None or self.lines.are_complete(self._shown_at, self.link)

    @property
    def _limit(self) -> float:
        return exchange.FIRST_PATIENCE if self.frames <= 1 else exchange.PATIENCE

    def _refuse_busy(self, busy: Busy) -> None:
        """Raises ApplicationFails where a thread has computed, or not come to wait, for too long."""
        name, service = _printable(busy.name), self._name(busy.service)
        whose = f" of service '{service}'" if service else ""
        way_out = "in lockstep the test goes on only when all threads wait"
        if busy.processor_s > self._limit:
            woken = f"went on and waited again and again in {self._limit:g} s of computing, without its time going on"
            did = woken if busy.state == "W" else f"computed for {self._limit:g} s without waiting"
            raise ApplicationFails(f"thread '{name}'{whose} {did}; {way_out}")
        if busy.wall_s > WALL_FACTOR * self._limit:
            state = f" (state {_printable(busy.state)})" if busy.state else ""
            raise ApplicationFails(
                f"thread '{name}'{whose} did not wait within {WALL_FACTOR * self._limit:g} s of wall time{state}; "
                f"{way_out}"
            )

    def _name(self, service: int) -> str:
        return self.names[service] if 0 <= service < len(self.names) else ""

    def _tell(self, report: Report) -> None:
        """Notes of the application's processes become the test's, each once; raises ServiceSilent."""
        missing = [name for number, name in enumerate(self.names) if number not in report.services]
        if missing and not self.frames:
            raise ServiceSilent(
                f"service '{missing[0]}' never loaded DoDo's clock, as statically linked programs do not: "
                "run the test with --clock realtime"
            )
        if not report.repeatable:
            self._note_once("not all services began at once, so the time before the test may differ from run to run")
        for note in report.notes:
            is_starting = note.kind == "spin" and self.frames <= 1  # libraries look at the clock as they are loaded
            if not is_starting and (sentence := _SENTENCES.get(note.kind)):
                self._note_once(sentence.format(service=self._name(note.service), name=_printable(note.name)))

    def _note_once(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < _MOST_NOTES:
            self._noted.add(text)
            tell("note", text=text)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


_SENTENCES = {
    "static": "service '{service}' started '{name}', a statically linked program, which keeps the machine's time",
    "setuid": "service '{service}' started '{name}', which changes its user and so keeps the machine's time",
    "slots": "service '{service}' has more threads than DoDo's clock can serve ('{name}')",
    "page": "the application wrote into what gives it the test's time; DoDo put right what others read there",
    "clone": "service '{service}' makes threads without the C library ('{name}'), which keep the machine's time",
    "spin": "a thread of service '{service}' asks for the time again and again without waiting ('{name}')",
}
