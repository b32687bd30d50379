"""The application under ``clock: virtual``: its own time is the test's, and goes on as far as the clock says.

The agent (``native/agent.c``) lets it run up to a time of the test, and says when all its threads wait for later. What
the application sends counts at the time at which it sent it. Computing takes none, so nothing is measured; who computes
on and on without waiting is named.
"""

import json
import os
import select
import stat
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.opendlv.channel import Done, Show
from dodo_dsl.opendlv.envelope import Envelope
from services.clock.answers import MessageFilter
from services.clock.exchange import (
    SLICE_S,
    ApplicationFloods,
    ApplicationSilent,
    IsStopped,
    Patience,
    ServiceLink,
    ServiceSilent,
)
from services.clock.printed_lines import PrintedLines
from services.clock.processor_time import ApplicationProcesses

MOST_SENT = 1000
"""Messages of one kind in a step; more of them are a flood."""
AGENT_PATIENCE_S = 60.0
"""Wall time in s for the agent to be there, and for an application that goes on without reaching the time."""
WALL_FACTOR = 10.0
"""How many times as long as it may compute a thread may take of wall time: others may have the processor."""
READER_PATIENCE_S = 10.0
"""Wall time in s for a camera to see that a reader waits, which it then does already."""
SPARE_S = 10
"""Seconds of its own time that the application has before the test begins."""
_NS = 1000
_MOST_TEXT = 1 << 16
_MOST_SERVICES, _MOST_NOTES = 64, 64


class Reached(NamedTuple):
    """All threads wait, at ``now_ns`` of test time; ``begun`` are the services that have had a process."""

    now_ns: int
    begun: frozenset[int]
    notes: tuple[tuple[str, int, str], ...]
    """Kind, service and name of a program."""
    is_repeatable: bool


class Busy(NamedTuple):
    """A thread that has not waited for a while; ``service`` is -1 where it is not known. Times in s."""

    service: int
    name: str
    state: str
    wall_s: float
    processor_s: float


class Destroyed(NamedTuple):
    """The application has made the page of the time unreadable."""


Report = Reached | Busy | Destroyed


def report_of(line: bytes) -> Report | None:
    """What a line of the agent says; None where it says nothing, because others may write there, too."""
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict):
        return None
    if message.get("destroyed") is True:
        return Destroyed()
    if isinstance(busy := message.get("busy"), dict):
        wall_s, processor_s = (_seconds(busy.get(key)) for key in ("wall_s", "processor_s"))
        return Busy(
            _number(busy.get("service"), -1), _text(busy.get("name")), _text(busy.get("state")), wall_s, processor_s
        )
    if type(now := message.get("now")) is not int:
        return None
    begun = frozenset(_number(one, -1) for one in _list(message.get("services"), _MOST_SERVICES))
    told = (note for note in _list(message.get("notes"), _MOST_NOTES) if isinstance(note, dict))
    notes = tuple((_text(n.get("kind")), _number(n.get("service"), -1), _text(n.get("name"))) for n in told)
    return Reached(now, begun, notes, message.get("repeatable") is not False)


def _list(value: object, most: int) -> list[Any]:
    return value[:most] if isinstance(value, list) else []


def _number(value: object, default: int) -> int:
    return value if type(value) is int else default


def _seconds(value: object) -> float:
    return float(value) if isinstance(value, int | float) and 0 <= value < 1e9 else 0.0


def _text(value: object) -> str:
    return "".join(c if c.isprintable() else "?" for c in value[:64]) if isinstance(value, str) else ""


class TimeAgent:
    """The agent over its two FIFOs in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._command = self._reply = -1
        self._text = bytearray()
        self._lines: list[bytes] = []
        self._poll = select.poll()

    def open(self, stopped: IsStopped) -> None:
        """Wait until it is there; raises ServiceSilent."""
        deadline = time.monotonic() + AGENT_PATIENCE_S
        while not (self._is_open() or stopped()):
            if time.monotonic() > deadline:
                raise ServiceSilent(f"nothing in {self._folder} lets the application's time go on (dodo-time)")
            time.sleep(SLICE_S)

    def _is_open(self) -> bool:
        try:
            if self._reply < 0:
                self._reply = _opened(self._folder / "reply", os.O_RDONLY)
                self._poll.register(self._reply, select.POLLIN)
            self._command = _opened(self._folder / "command", os.O_WRONLY)
        except OSError:
            return False
        return True

    def run(self, until: int) -> None:
        """Let the application go on to a time of the test (us); raises ServiceSilent."""
        self._send(f"run {until * _NS}")

    def report(self, timeout: float) -> Report | None:
        """The next report, or None after ``timeout`` seconds; raises ServiceSilent."""
        if not self._lines and self._poll.poll(timeout * 1000):
            self._read()
        return report_of(self._lines.pop(0)) if self._lines else None

    def close(self) -> None:
        """The agent ends, and nothing of the application goes on."""
        for descriptor in (self._command, self._reply):
            if descriptor >= 0:
                os.close(descriptor)
        self._command = self._reply = -1

    def _send(self, line: str) -> None:
        try:
            os.write(self._command, f"{line}\n".encode())
        except OSError:
            raise ServiceSilent("what lets the application's time go on has ended (dodo-time)") from None

    def _read(self) -> None:
        try:
            data = os.read(self._reply, _MOST_TEXT)
        except BlockingIOError:
            return
        if not data:
            raise ServiceSilent("what lets the application's time go on has ended (dodo-time)")
        self._text += data
        *lines, rest = bytes(self._text).split(b"\n")
        self._lines += lines
        self._text = bytearray(rest if len(rest) < _MOST_TEXT else b"")


def _opened(path: Path, access: int) -> int:
    descriptor = os.open(path, access | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW)
    if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a FIFO")
    return descriptor


@dataclass
class SentMessages:
    """Collects all that the application sends and services consume, those of ``heard``, from ``begin`` on.

    Messages under other sender stamps are passed on, too, as services count them.
    """

    heard: tuple[MessageFilter, ...]
    surplus: int = 0
    """None is too many here."""
    answers: int = 0
    """Steps in which it sent something that matters."""
    uncopied: int = 0
    """Those of them in which that did not carry the sample time of a frame."""
    _frames: set[int] = field(default_factory=set)
    _sent: list[Envelope] = field(default_factory=list)
    _counts: Counter[int] = field(default_factory=Counter)
    _has_begun: bool = False

    @property
    def filters(self) -> tuple[MessageFilter, ...]:
        """All messages that matter here."""
        return self.heard

    def begin(self) -> None:
        """From now on what is sent counts: the test begins."""
        self._has_begun = True

    def expect(self, sampled: Iterable[int]) -> None:
        """Frames with these sample times (us) are shown."""
        self._frames.update(sampled)

    def take(self, envelope: Envelope) -> None:
        """Take a message from the bus; raises ApplicationFloods."""
        if not self._has_begun or all(each.data_type != envelope.data_type for each in self.heard):
            return
        self._counts[envelope.data_type] += 1
        if self._counts[envelope.data_type] > MOST_SENT:
            name = next(each.name for each in self.heard if each.data_type == envelope.data_type)
            message = name.partition("/")[0].rpartition(".")[2]
            raise ApplicationFloods(
                f"the application sent more than {MOST_SENT} {message}s within a step: it floods the bus"
            )
        self._sent.append(envelope)

    def collect(self, after: int, until: int) -> list[Envelope]:
        """What was sent, by the application's own time, which lies in the step that begins ``after`` a time (us).

        It counts from the next microsecond on, so that it acts on no update of the time at which it was sent.
        """
        sent, self._sent = self._sent, []
        self._counts.clear()
        own = [envelope for envelope in sent if any(each.matches(envelope) for each in self.heard)]
        self.answers += bool(own)
        self.uncopied += any(envelope.sample_time not in self._frames for envelope in own)
        return [envelope._replace(received=min(max(envelope.sent, after) + 1, until)) for envelope in sent]

    def facts(self) -> dict[str, Any]:
        """What the clock reports of the answers: how many carried sample times; their times are not measured."""
        if not self.answers:
            return {}
        times = dict.fromkeys(("period_s", "median_s", "p95_s", "worst_s"), 0.0)
        unseen = dict.fromkeys(("processor_median_s", "processor_p95_s", "processor_worst_s", "over"))
        return {"answers": self.answers, **times, **unseen, "slow": 0, "uncopied": self.uncopied, "processor": ""}


class VirtualApplication:
    """Lets the application go on from step to step, and shows pictures when they are due; ``frames`` counts steps.

    ``names`` are those of its services, by which the agent numbers them, and ``note`` takes notes on the test.
    """

    has_own_time = True

    def __init__(
        self,
        answers: SentMessages,
        agent: TimeAgent,
        patience: Patience,
        link: ServiceLink,
        stopped: IsStopped,
        names: Sequence[str],
        note: Callable[[str], None],
    ) -> None:
        self.answers = answers
        self.frames = 0
        self.waited_first, self.waited = 0.0, 0.0
        """Wall time in s up to the second step, and since."""
        self.processes = ApplicationProcesses(())
        self._agent, self._patience, self._link, self._stopped = agent, patience, link, stopped
        self._names, self._note = names, note
        self.lines: PrintedLines | None = None
        """What it prints as messages, if it does."""
        self._noted: set[str] = set()
        self._has_shown: set[str] = set()
        self._shown_at = self._until = 0

    def facts(self) -> dict[str, Any]:
        """What the clock reports of the answers at the end."""
        return self.answers.facts()

    def begin(self, now: int) -> None:
        """Let it come to the start of the test (us), before services send anything; what it sent is left out.

        Raises as ``show``.
        """
        self._agent.open(self._stopped)
        self._run(now)
        self.answers.begin()

    def pause(self) -> None:
        """It acts by the test's time: there is no other one to look for."""

    def expect_at(self, now: int) -> None:
        """Without cameras, nothing is to be expected."""

    def remember(self, messages: Iterable[Envelope]) -> None:
        """What services have sent is not said again: the application has had time to begin."""

    def show(self, shown: Sequence[Done], now: int) -> None:
        """Let it take what services have sent by ``now`` (us), then show it new pictures, whether it waits or not.

        For the first ones it has to wait; raises ApplicationSilent, ApplicationFloods and ServiceSilent.
        """
        self.frames += 1
        self._shown_at = now
        self._run(now)
        self.answers.expect(camera.sampled for camera in shown)
        for camera in shown:
            self._link.send(camera.service, Show(awaits=camera.service not in self._has_shown, announces=True))
        for camera in shown:
            self._await_camera(camera.service)
            self._has_shown.add(camera.service)

    def await_answer(self, until: int) -> None:
        """Let it go on to ``until`` (us); raises ApplicationSilent, ApplicationFloods and ServiceSilent."""
        self._until = until
        self._run(until)

    def collect(self) -> list[Envelope]:
        """The application's messages since the last time, for the services, in the order in which they were sent."""
        return self.answers.collect(self._shown_at, self._until)

    def _await_camera(self, camera: str) -> None:
        began = time.monotonic()
        while self._link.result(camera, SLICE_S) is None and not self._stopped():
            if self.frames == 1 and time.monotonic() - began > READER_PATIENCE_S:
                raise ApplicationSilent(
                    f"no reader waited for a picture of '{camera}' within {SPARE_S} s of the application's own time"
                )
            if time.monotonic() - began > AGENT_PATIENCE_S:
                raise ServiceSilent(f"service '{camera}' did not show its picture within {AGENT_PATIENCE_S:g} s")

    def _run(self, until: int) -> None:
        began = time.monotonic()
        self._agent.run(until)
        while not self._stopped():
            report = self._agent.report(SLICE_S)
            self._link.drain()
            if isinstance(report, Reached):
                self._tell(report)
                if report.now_ns >= until * _NS:
                    if self._has_lines(until):
                        break
                    self._agent.run(until)
            elif isinstance(report, Destroyed):
                raise ApplicationSilent("the application destroyed the page that gives it the test's time")
            elif isinstance(report, Busy):
                self._refuse_busy(report)
            if time.monotonic() - began > max(AGENT_PATIENCE_S, WALL_FACTOR * self._limit):
                raise ApplicationSilent(
                    f"the application did not come to {(until - self._shown_at) / 1e6:g} s "
                    f"of its own time within {time.monotonic() - began:.0f} s of wall time"
                )
        spent = time.monotonic() - began
        self.waited_first += spent if self.frames <= 1 else 0.0
        self.waited += spent if self.frames > 1 else 0.0

    def _has_lines(self, until: int) -> bool:
        """Whether all that it has printed in this step is taken, and it still rests; raises ServiceSilent."""
        is_shown_next = until == self._shown_at
        return is_shown_next or self.lines is None or self.lines.are_complete(self._shown_at or until, self._link)

    @property
    def _limit(self) -> float:
        return self._patience.first if self.frames <= 1 else self._patience.others

    def _refuse_busy(self, busy: Busy) -> None:
        """Raises ApplicationSilent where a thread has computed, or not come to wait, for too long."""
        whose = f" of service '{self._name(busy.service)}'" if self._name(busy.service) else ""
        way_out = "with clock: virtual the test goes on only when all threads wait"
        if busy.processor_s > self._limit:
            raise ApplicationSilent(
                f"thread '{busy.name}'{whose} computed for {self._limit:g} s without waiting; {way_out}"
            )
        if busy.wall_s > WALL_FACTOR * self._limit:
            state = f" (state {busy.state})" if busy.state else ""
            raise ApplicationSilent(
                f"thread '{busy.name}'{whose} did not wait within {WALL_FACTOR * self._limit:g} s of wall time{state}; "
                f"{way_out}"
            )

    def _name(self, service: int) -> str:
        return self._names[service] if 0 <= service < len(self._names) else ""

    def _tell(self, reached: Reached) -> None:
        """Notes of the application's processes become the test's, each once; raises ServiceSilent."""
        missing = [name for number, name in enumerate(self._names) if number not in reached.begun]
        if missing and not self.frames:
            raise ServiceSilent(
                f"service '{missing[0]}' never loaded DoDo's clock, as programs do not that are statically linked or "
                "of another C library: run the test with --clock lockstep or --clock realtime"
            )
        if not reached.is_repeatable:
            self._note_once("not all services began at once, so the time before the test may differ from run to run")
        for kind, service, name in reached.notes:
            is_starting = kind == "spin" and self.frames <= 1  # libraries look at the clock as they are loaded
            if not is_starting and (sentence := _SENTENCES.get(kind)):
                self._note_once(sentence.format(service=self._name(service), name=name))

    def _note_once(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < _MOST_NOTES:
            self._noted.add(text)
            self._note(text)


_SENTENCES = {
    "static": "service '{service}' started '{name}', a statically linked program, which keeps the machine's time",
    "setuid": "service '{service}' started '{name}', which changes its user and so keeps the machine's time",
    "slots": "service '{service}' has more threads than DoDo's clock can serve ('{name}')",
    "page": "the application wrote into what gives it the test's time; DoDo put right what others read there",
    "spin": "a thread of service '{service}' asks for the time again and again without waiting ('{name}')",
}
