"""The clock on the bus: it waits for the test's begin, steps it to its end, and reports its progress to the runner."""

import logging
import os
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageError
from dodo_dsl.opendlv.session import Session
from services.base.clock import MICROSECONDS
from services.base.lockstep_clock import EPOCH
from services.base.members import SenderTable
from services.base.runner import tell
from services.base.service import Service
from services.clock.agent import TimeAgent
from services.clock.answers import AnsweringApplication, Answers
from services.clock.exchange import Exchange, Patience, Roles, TestEnded, Timing
from services.clock.model import Stepper
from services.clock.printed_lines import PrintedLines
from services.clock.resting import ResponseTimes, RestingApplication, SentMessages

_REPORT_S = 0.1
"""Seconds between reports: what was measured by the wall clock is put to the test's time by them."""
_SLICE = 0.05
BEGIN = "dodo.TestBegin"

_log = logging.getLogger(__name__)


class OwnTime(NamedTuple):
    """What lets the time of the application go on, and the ``names`` of its services."""

    agent: TimeAgent
    names: tuple[str, ...]


class ClockService(Service):
    def __init__(
        self,
        session: Session,
        path: Path,
        roles: Roles,
        answers: Answers | SentMessages,
        timing: Timing,
        senders: SenderTable | None = None,
        own_time: OwnTime | None = None,
        *,
        prints: bool = False,
    ) -> None:
        """Services connect at ``path``. With ``own_time`` the application rests; ``prints``: it prints messages."""
        self._session = session
        self._begin_id = session.messages.id(BEGIN)
        self._senders = senders or SenderTable(session.messages)
        self._answers = answers
        self._lines = PrintedLines(session, self._over) if prints else None
        self._exchange = exchange = Exchange(session, path, roles.all, self._take, self._senders)
        self._application: AnsweringApplication | RestingApplication
        if isinstance(answers, SentMessages):
            assert own_time is not None, "the program gives it"
            response = ResponseTimes(float(timing.period) / MICROSECONDS, timing.max_response)
            self._application = RestingApplication(
                answers, own_time.agent, Patience(), exchange, self._over, response, own_time.names, self._note
            )
            self._application.lines = self._lines
        else:
            self._application = AnsweringApplication(answers, Patience(), exchange, self._over)
        self._stepper = Stepper(roles, timing.period, timing.timeout, self._application, exchange, self._over)
        self._reported = self._begun = 0.0
        self._stopped: Callable[[], bool] = lambda: False
        self.drive = self._drive

    def _drive(self, stopped: Callable[[], bool]) -> None:
        self._stopped = stopped
        with closing(self._exchange):
            self._step()

    def _step(self) -> None:
        ended: TestEnded | None = None
        try:
            self._stepper.connect()
            if (begin := self._await_begin()) is None:
                return
            self._begun = time.monotonic()
            self._report_time()
            self._stepper.run(begin)
        except TestEnded as problem:
            ended = problem
        spent = sorted(((n, s) for n, s in self._stepper.spent.items() if n), key=lambda item: -item[1])
        _log.info("waited for %s", ", ".join(f"{name} {seconds:.3f} s" for name, seconds in spent))
        if facts := self._application.facts():
            tell("response", response=facts)
        if self._begun:
            self._report_time(last=True)
        if ended is not None:
            tell("stopped", how=ended.kind, reason=str(ended), silent=ended.silent)

    def _take(self, envelope: Envelope) -> None:
        if self._lines and self._lines.take(envelope):
            return
        takers = self._stepper.takers(envelope.data_type)
        if takers and any(each.matches(envelope) for each in self._answers.filters):
            with suppress(MessageError):  # its takers say so
                message = self._session.messages.decode(envelope.data_type, envelope.payload)
                self._senders.check_numbers(message, envelope.sender_stamp, takers, self._stepper.now - EPOCH)
        self._answers.take(envelope)

    def _over(self) -> bool:
        if self._begun and time.monotonic() - self._reported > _REPORT_S:
            self._report_time()
        return self._stopped()

    def _await_begin(self) -> Envelope | None:
        """The start that the runner announces; one of its own where DODO_RUNNER says that there is none."""
        self._stepper.start()
        if os.environ.get("DODO_RUNNER") == "":
            begin = self._session.messages.type(BEGIN)()
            return Envelope(self._begin_id, self._session.messages.encode(begin), 0, 0, 0, 0)
        tell("started")
        while not self._stopped():
            envelope = self._session.receive(_SLICE)
            if envelope is None:
                continue
            if envelope.data_type == self._begin_id and self._senders.is_of_runner(envelope, self._session.source):
                self._session.hear_directly(self._lines is not None)
                return envelope
            if not self._session.was_direct:
                self._exchange.hear(envelope, self._session.source)
        return None

    def _report_time(self, last: bool = False) -> None:
        self._reported = time.monotonic()
        tell("time", seconds=(self._stepper.reached - EPOCH) / 1e6, last=last)

    def _note(self, text: str) -> None:
        tell("note", text=text)
