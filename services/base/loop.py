"""The one loop of all services: deliver, update, send, until there is a verdict, an end or a signal."""

import logging
import operator
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction

from google.protobuf.message import Message

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError, decode
from dodo_dsl.opendlv.protobuf_classes import Layout
from dodo_dsl.opendlv.session import Session, SessionError, datagram
from services.base.clock import MICROSECONDS, Clock
from services.base.evaluator import UnjudgeableError
from services.base.members import END_OF_INPUT, NOT_SHOWN, Members, World
from services.base.runner import tell
from services.base.service import IDLE_PERIOD, Framed, Handler, Output, Service, UnusableMessageError

SHORTEST = 10_000
"""Microseconds; less harms no test, and usual on any machine."""


class Lateness:
    """Counts updates that end late from ``begin`` on. Times in microseconds of test time."""

    def __init__(self, period: Fraction | int | None, late_after: float | None) -> None:
        self._period = period or 0
        self._late_after = max(float(self._period) / 2, SHORTEST) if late_after is None else late_after
        self._last: int | None = None
        self._has_begun = False
        self._updates = self._worst = self.late = 0

    def begin(self) -> None:
        self._has_begun = True

    def add(self, due: int, ended: int) -> None:
        """The update of the instant ``due`` has ended. Instants between the last one and this were skipped, so late."""
        skipped = round((due - self._last) / self._period) - 1 if self._last is not None and self._period else 0
        self._last = due
        if self._has_begun:
            self._updates += 1 + max(skipped, 0)
            self.late += (ended - due > self._late_after) + max(skipped, 0)
            self._worst = max(self._worst, ended - due)

    def facts(self) -> dict[str, int | float]:
        return {"updates": self._updates, "late": self.late, "worst_s": round(self._worst / MICROSECONDS, 3)}


TEST_BEGIN = "dodo.TestBegin"
REPORT_PERIOD = 1_000_000

_log = logging.getLogger(__name__)


@dataclass
class Loop:
    """Runs a service on a session by a clock; ``sender_stamp`` is that of outputs without one.

    ``name`` is the source in its EndOfInput. Raises what the model raises, SessionError, and ValueError for a period
    that is none.
    """

    name: str
    service: Service
    session: Session
    clock: Clock
    sender_stamp: int
    members: Members | None = None
    """In real time: the services of the test, whose messages others must not send."""
    ends_input: bool = False
    """Whether the verdict ends the test: the others decide on what came until then."""
    _handlers: dict[int, list[tuple[int | None, Handler, Layout]]] = field(default_factory=dict)
    _heard: Counter[tuple[int, int]] = field(default_factory=Counter)
    _unusable: set[tuple[int, int]] = field(default_factory=set)
    _began: int | None = None
    _reported: tuple[int, int, float] = (0, 0, 0.0)
    """Messages lost, updates late and seconds paused, as they were reported last."""
    _report_after: int = 0
    _lateness: Lateness = field(init=False)
    _world: World = field(init=False)

    def __post_init__(self) -> None:
        ids = self.session.messages.id
        for (name, stamp), handler in self.service.inputs.items():
            entry = (stamp, handler, self.session.messages.layout(name))
            self._handlers.setdefault(ids(name), []).append(entry)
        if type(self.service).not_shown is not Service.not_shown:
            entry = (None, self.service.not_shown, self.session.messages.layout(NOT_SHOWN))
            self._handlers[ids(NOT_SHOWN)] = [entry]
        self._begin, self._end = ids(TEST_BEGIN), ids(END_OF_INPUT)
        period = self.service.period
        if period is not None and (period < 1 or (period % 1 and not isinstance(period, Fraction))):
            expected = "expected microseconds, 1 or more: period_of(freq) gives them"
            raise ValueError(f"the period of {type(self.service).__name__} is {period}, {expected}")
        self._lateness = Lateness(self.service.period, self.service.late_after)
        self._world = World(self.session.messages)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until the service is done, or ``stopped``; memories of a source stay until all have judged."""
        try:
            self._run(stopped)
        except UnjudgeableError as error:
            raise UnjudgeableError("; ".join([str(error), *self.strangers()])) from None
        self._hear_rest()
        if self.service.finished and self.service.verdict is None:
            tell("end-of-input")
        if self.service.finished if self.service.verdict is None else self.ends_input:
            self._send(self.session.messages.type(END_OF_INPUT)(source=self.name), self.clock.now())
        self.clock.close(stopped if self._began is not None else lambda: True)
        self._tell_strangers()
        self._report(self.clock.now())

    def _run(self, stopped: Callable[[], bool]) -> None:
        service = self.service

        def over() -> bool:
            return stopped() or service.verdict is not None

        for now in self.clock.steps(service.period or IDLE_PERIOD, self, over):
            if service.period is not None:
                for output in service.update(now):
                    self._send(output, now)
                if not self.clock.relays:
                    self._lateness.add(now, self.clock.now())
            if now >= self._report_after:
                self._report(now)
            if service.finished and not self.clock.has_new_picture:
                return

    def _hear_rest(self) -> None:
        """An observer gets what came before its end."""
        end = time.time_ns() // 1000
        while self.observe and not self.clock.relays and self.service.verdict is None:
            envelope = self.receive(0.0)
            if envelope is None or envelope.received > end:
                return
            self.handle(envelope)

    def receive(self, timeout: float) -> Envelope | None:
        return self.session.receive(timeout)

    @property
    def observe(self) -> Callable[[Envelope], None] | None:
        """What takes everything on the bus, where the service does."""
        return self.service.observe

    @property
    def consumes(self) -> frozenset[int]:
        return frozenset([*self._handlers, self._begin, self._end])

    def handle(self, envelope: Envelope) -> None:
        """For the clock: let the service handle an envelope; an observer gets one that does not count, too."""
        counts = self.members is None or self.members.admits(envelope)
        if not self.clock.relays and self.service.observe is not None:
            self.service.observe(envelope if counts else envelope._replace(received=0))
        if not counts:
            return
        self.service.arrived = self.clock.now() if self.clock.relays else envelope.received
        if envelope.data_type in self._handlers:
            self._heard[envelope.data_type, envelope.sender_stamp] += 1
        if envelope.data_type == self._begin:
            self._began = envelope.sample_time
            if self.members is not None:
                self.members.begin()
            self.service.begin(envelope.sample_time)
            self._lateness.begin()
        elif envelope.data_type == self._end:
            self.service.end_of_input(self.clock.now())
        for stamp, handler, layout in self._handlers.get(envelope.data_type, ()):
            if stamp is None or stamp == envelope.sender_stamp:
                try:
                    message = decode(layout, envelope.payload)
                except MessageError as error:
                    self._ignore(envelope, error)
                    return
                if self.members is not None:
                    began, arrived = self._began, self.service.arrived
                    elapsed = arrived - began if began and arrived else None
                    self.members.check_numbers(envelope, message, elapsed)
                try:
                    handler(message, envelope.sample_time)
                except UnusableMessageError as error:
                    self._ignore(envelope, error)

    def _ignore(self, envelope: Envelope, error: Exception) -> None:
        if (key := (envelope.data_type, envelope.sender_stamp)) not in self._unusable:
            self._unusable.add(key)
            name = self.session.messages.name(envelope.data_type)
            _log.warning("ignored this and all such %s/%d: %s", name, envelope.sender_stamp, error)

    def strangers(self) -> list[str]:
        """A sentence for each input that never came, while others of its type did: that is easily taken for silence."""
        found, ids = [], self.session.messages.id
        for name, stamp in self.service.inputs:
            known = {other for own, other in self.service.inputs if own == name}
            heard = {s: count for (id_, s), count in sorted(self._heard.items()) if id_ == ids(name)}
            others = [f"{count} with sender stamp {s}" for s, count in heard.items() if s not in known]
            if None not in known and stamp not in heard and others:
                found.append(f"no {name}/{stamp} came, but {' and '.join(others)}")
        return found

    def _tell_strangers(self) -> None:
        """In the reason of a failed verdict, because they may explain it, else as notes."""
        strangers, verdict = self.strangers(), self.service.verdict
        if strangers and verdict is not None and verdict.outcome == "failed":
            reason = "; ".join([verdict.reason, *strangers])
            self.service.verdict, strangers = replace(verdict, reason=reason, silent=False), []
        for text in (*strangers, *self.service.notes):
            tell("note", text=text)

    def _report(self, now: int) -> None:
        """What has gone on since the last report."""
        session, lateness, paused = self.session, self._lateness, self.service.paused
        if (session.lost, lateness.late, paused) == self._reported:
            return
        lost, late, was_paused = self._reported
        self._reported, self._report_after = (session.lost, lateness.late, paused), now + REPORT_PERIOD
        if session.lost > lost:
            tell("lost", messages=session.lost)
        if lateness.late > late:
            tell("late", **lateness.facts())
        if paused > was_paused:
            tell("paused", seconds=round(paused, 3))

    def _send(self, output: Message | Output | Envelope | list[Framed], now: int) -> None:
        if not isinstance(output, list):
            output = [(output if isinstance(output, Envelope) else self._envelope(output, now), b"")]
        frames = []
        for envelope, frame in output:
            self.clock.sent(envelope)
            if not self._world.holds(envelope):
                frames.append(frame or datagram(envelope))
            elif self.members is not None:
                self.session.send_frames(frames)
                frames = []
                self.members.send(envelope)
            elif not self.clock.relays:
                name = self.session.messages.name(envelope.data_type)
                raise SessionError(f"'{name}' must not come to the bus, and the services that get it are not known")
        self.session.send_frames(frames)

    def _envelope(self, output: Message | Output, now: int) -> Envelope:
        message, stamp, sampled = output if isinstance(output, Output) else Output(output, self.sender_stamp)
        messages, sent = self.session.messages, now if self.clock.relays else time.time_ns() // 1000
        sample_time = now if sampled is None else sampled
        numbers = operator.index(sample_time), operator.index(stamp)  # a service may have them of numpy
        return Envelope(messages.id(message), messages.encode(message), sent, 0, *numbers)
