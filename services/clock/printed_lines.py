"""What the application prints as messages: the runner reads it, and sends them to the clock before time goes on."""

import time
from typing import Any

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.runner import tell
from services.clock.exchange import SLICE_S, ApplicationFloods, Exchange, ServiceSilent

PATIENCE_S = 240.0
"""Wall time in s for the runner to read and match what is printed, which has its own limit."""

MOST_TURNS = 1000
"""In which it prints as much as a terminal holds, within a step."""


class PrintedLines:
    """Asks the runner for all that the application has printed so far."""

    def __init__(self, messages: MessageSet) -> None:
        self._messages, self._id = messages, messages.id("dodo.LinesRead")
        self._read: Envelope | None = None
        self._turns, self._goes_on = 0, False

    def take(self, envelope: Envelope) -> bool:
        if envelope.data_type != self._id:
            return False
        self._read = envelope
        return True

    def are_complete(self, now: int, link: Exchange) -> bool:
        """Take the messages of an application that rests, at a time of the test (us).

        False where it may have waited only for its lines to be read, or gets them itself. Raises TestEnded.
        """
        self._turns = self._turns + 1 if self._goes_on else 0
        if self._turns > MOST_TURNS:
            raise ApplicationFloods("the application prints on and on within a step: it floods its output")
        self._read, end = None, time.monotonic() + PATIENCE_S
        tell("rest", time=now)
        while self._read is None or self._read.sample_time != now:
            if link.stopped():
                return True
            if time.monotonic() > end:
                raise ServiceSilent(f"what the application printed was not read within {PATIENCE_S:g} s")
            link.pump(SLICE_S)
        link.drain()
        read: Any = self._messages.decode(self._id, self._read.payload)
        self._goes_on = read.goesOn
        return not read.goesOn
