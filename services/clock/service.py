"""The clock on the bus: it waits for the test's begin, steps it to its end, and reports its progress to the runner."""

import os
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError
from services.base import Context, Service, period_of
from services.base.clock import MICROSECONDS
from services.base.clock_link import socket_path
from services.base.lockstep_clock import EPOCH
from services.base.members import SenderTable
from services.base.runner import tell
from services.clock.agent import TimeAgent
from services.clock.answers import AnsweringApplication, filters
from services.clock.exchange import SLICE_S, Exchange, Roles, ServiceSilent, TestEnded
from services.clock.model import Stepper
from services.clock.printed_lines import PrintedLines
from services.clock.resting import ResponseTimes, RestingApplication

_REPORT_S = 0.1
"""Seconds between reports: what was measured by the wall clock is put to the test's time by them."""
BEGIN = "dodo.TestBegin"


class ClockService(Service):
    """Takes messages as they come, as long as ``drive`` runs. Services connect at ``socket_path``."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for messages that are none, and OSError."""
        assert context.session is not None, "the program gives its session"
        self._session, flags = context.session, context.flags
        self._begin_id = self._session.messages.id(BEGIN)
        self._senders = SenderTable(context.messages)
        self._lines = PrintedLines(context.messages) if flags["prints"] else None
        roles = Roles(*(tuple(flags[name]) for name in ("advance", "sense", "judge", "watch")))
        self._exchange = Exchange(self._session, socket_path(), roles.all, self._take, self._over, self._senders)
        self._application = self._application_of(context)
        self._session.hear_only([*(each.data_type for each in self._application.filters), *self._senders.ids])
        period, timeout = period_of(flags["freq"]), round(flags["timeout"] * MICROSECONDS)
        self._stepper = Stepper(roles, period, timeout, self._application, self._exchange)
        self._begin: Envelope | None = None
        self._reported = self._begun = 0.0
        self._stopped: Callable[[], bool] = lambda: False
        self.drive = self._drive

    def _application_of(self, context: Context) -> AnsweringApplication | RestingApplication:
        """The application, which rests where something lets its time go on, and else answers."""
        flags = context.flags
        required, relayed = (filters(flags[name], context.messages) for name in ("answers", "hears"))
        done = filters([flags["done"]], context.messages)[0] if flags["done"] else None
        answering = AnsweringApplication(self._exchange, required, relayed, done)
        if not flags["time-folder"] or os.environ.get("DODO_ANSWERS"):
            return answering
        agent = TimeAgent(Path(flags["time-folder"]))
        context.resources.callback(agent.close)
        with suppress(ServiceSilent):  # the first step says so; it is opened before an application could find it
            agent.open()
        response, names = ResponseTimes(1 / flags["freq"], flags["max-response"]), flags["application"]
        return RestingApplication(self._exchange, answering.filters, agent, response, names, self._lines)

    def _drive(self, stopped: Callable[[], bool]) -> None:
        self._stopped = stopped
        with closing(self._exchange):
            self._step()

    def _step(self) -> None:
        ended: TestEnded | None = None
        try:
            self._stepper.start()
            if (begin := self._await_begin()) is None:
                return
            self._begun = time.monotonic()
            self._report_time()
            self._stepper.run(begin)
        except TestEnded as problem:
            ended = problem
        if facts := self._application.facts():
            tell("response", response=facts)
        if self._begun:
            self._report_time(last=True)
        if ended is not None:
            tell("stopped", how=ended.kind, reason=str(ended), silent=ended.silent)

    def _take(self, envelope: Envelope) -> None:
        if envelope.data_type == self._begin_id:
            self._begin = envelope
        if self._lines and self._lines.take(envelope):
            return
        takers = self._stepper.takers(envelope.data_type)
        if takers and any(each.matches(envelope) for each in self._application.filters):
            with suppress(MessageError):  # its takers say so
                message = self._session.messages.decode(envelope.data_type, envelope.payload)
                self._senders.check_numbers(message, envelope.sender_stamp, takers, self._stepper.now - EPOCH)
        self._application.take(envelope)

    def _over(self) -> bool:
        if self._begun and time.monotonic() - self._reported > _REPORT_S:
            self._report_time()
        return self._stopped()

    def _await_begin(self) -> Envelope | None:
        """The start that the runner announces; one of its own where DODO_RUNNER says that there is none."""
        if os.environ.get("DODO_RUNNER") == "":
            begin = self._session.messages.type(BEGIN)()
            return Envelope(self._begin_id, self._session.messages.encode(begin), 0, 0, 0, 0)
        tell("started")
        while self._begin is None and not self._stopped():
            self._exchange.pump(SLICE_S)
        self._session.hear_directly(self._lines is not None)
        return self._begin

    def _report_time(self, last: bool = False) -> None:
        self._reported = time.monotonic()
        tell("time", seconds=(self._stepper.reached - EPOCH) / 1e6, last=last)


build = ClockService
