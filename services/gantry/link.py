"""The line to the rig: found first, then supervised, and never left without a stop."""

import contextlib
import logging
import time
from collections.abc import Callable
from typing import NamedTuple

from services.gantry.conversion import Conversion
from services.gantry.port import PortError, SerialLine
from services.gantry.protocol import LATCHED, Circle, Limits, LineReader, Position, Refusal, Status, Word, command

SILENCE = 1.0
"""s without an answer after which a line counts as lost."""
PATIENCE = 5.0
"""s that a rig has to answer at first: an Arduino that was plugged in needs two."""
RETRY = 0.25
STOP_TRIES, STOP_PATIENCE = 3, 0.2
REQUEST_STATE = command(Word.POSITION) + command(Word.STATUS)

_log = logging.getLogger(__name__)


class RigError(RuntimeError):
    """The rig cannot go on; one sentence."""


class LinkAnswers(NamedTuple):
    """A rig's answers; None for one that did not come."""

    at: Position | None = None
    status: Status | None = None
    refusals: tuple[Refusal, ...] = ()
    circle: Circle | None = None
    limits: Limits | None = None


class Link:
    """Commands the rig over a line that it opens; ``name`` names the line in errors.

    It sends nothing on its own, so that a fault can still be read when the line is opened.
    """

    def __init__(
        self,
        name: str,
        open_port: Callable[[], SerialLine],
        now: Callable[[], float] = time.monotonic,
        conversion: Conversion | None = None,
    ) -> None:
        """``now`` in s; the line is opened by the first exchange. Positions that it gives are true ones."""
        self.name = name
        self.conversion = conversion or Conversion()
        self._open, self._now = open_port, now
        self._port: SerialLine | None = None
        self._lines = LineReader()
        self._last_state = self._retry = now()
        self._found = False
        self._status: Status | None = None

    def exchange(self, lines: bytes, patience: float) -> LinkAnswers:
        """Send commands of which STATUS is the last, and wait up to ``patience`` s for its answer.

        A rig that has not answered yet has PATIENCE to do so, without answers meanwhile. From its first answer on:
        RigError when the line is lost or silent for SILENCE. Raises PortError when the line cannot be
        opened.
        """
        try:
            if self._port is None and not self._opened():
                return LinkAnswers()
            assert self._port is not None
            late = self._lines.feed(self._port.read(0.0))
            if lines != REQUEST_STATE:
                self._status = None
            self._port.write(lines)
            answers = self._answers(self._port, patience)
        except OSError as error:
            self._let_go()
            self._miss(error.strerror or str(error))
            return LinkAnswers()
        if self._now() - self._last_state > SILENCE:
            self._miss("it does not answer")
        return answers._replace(refusals=(*(a for a in late if isinstance(a, Refusal)), *answers.refusals))

    def close(self) -> None:
        """Stop the rig, wait for its confirmation as far as the line allows, and close the line.

        A rig that a fault has stopped is left alone: STOP would acknowledge the fault.
        """
        reason = "it does not answer"
        try:
            port, self._port = self._port or self._open(), None
            with contextlib.closing(port):
                if self._status in LATCHED:
                    return
                for _ in range(STOP_TRIES):
                    port.write(command(Word.STOP) + command(Word.STATUS))
                    if self._answers(port, STOP_PATIENCE).status is not None:
                        return
        except OSError as error:
            reason = str(error)
        _log.warning("the rig at %s did not confirm that it stopped: %s", self.name, reason)

    def _answers(self, port: SerialLine, patience: float) -> LinkAnswers:
        at, status, circle, limits, refusals = None, None, None, None, []
        end = self._now() + patience
        while status is None and (left := end - self._now()) > 0:
            for answer in self._lines.feed(port.read(left)):
                self._last_state, self._found = self._now(), True
                if isinstance(answer, Position):
                    at = self.conversion.to_true(answer)
                elif isinstance(answer, Status):
                    status = self._status = answer
                elif isinstance(answer, Circle):
                    circle = answer
                elif isinstance(answer, Limits):
                    limits = answer
                else:
                    refusals.append(answer)
        return LinkAnswers(at, status, tuple(refusals), circle, limits)

    def _opened(self) -> bool:
        now = self._now()
        if now < self._retry:
            return False
        self._retry = now + RETRY
        try:
            self._port, self._lines = self._open(), LineReader()
        except OSError as error:
            if now - self._last_state > PATIENCE:
                raise PortError(
                    f"the line to the rig at {self.name} cannot be opened: {error.strerror or error}"
                ) from None
            return False
        return True

    def _miss(self, reason: str) -> None:
        """The line is lost, or has not been found yet."""
        if self._found:
            raise RigError(f"the line to the rig at {self.name} is lost: {reason}")
        if self._now() - self._last_state > PATIENCE:
            raise RigError(f"the rig at {self.name} gave no answer for {PATIENCE:g} s: {reason}")

    def _let_go(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
