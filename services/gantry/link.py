"""The line to the rig, kept up: opened anew when it is lost, and never left without a stop."""

import contextlib
import logging
import time
from collections.abc import Callable

from services.gantry.port import Port
from services.gantry.protocol import Answer, Lines, Position, Status, Word, command

SILENCE = 1.0
"""s without an answer after which a line counts as lost."""
PATIENCE = 5.0
"""s that a rig may be away: an Arduino that was plugged in needs two until it answers."""
RETRY = 0.25
GRACE = 1.0
STOP_TRIES, STOP_PATIENCE = 3, 0.2

_log = logging.getLogger(__name__)


class RigError(RuntimeError):
    """The rig cannot go on; one sentence."""


class Link:
    """Asks the rig over a line that it opens; ``name`` is the line's, for sentences."""

    def __init__(self, name: str, open_port: Callable[[], Port], now: Callable[[], float] = time.monotonic) -> None:
        """``now`` in s; the line is opened by the first exchange."""
        self.name = name
        self._open, self._now = open_port, now
        self._port: Port | None = None
        self._lines = Lines()
        self._heard = self._up_since = self._retry = now()
        self._reason = "it does not answer"

    @property
    def fresh(self) -> bool:
        """Whether the line was opened only now: the rig may have braked in the meantime."""
        return self._now() - self._up_since < GRACE

    def exchange(
        self, lines: bytes, patience: float, wanted: type | None = None
    ) -> tuple[Position | None, Status | None]:
        """Send commands that ask for position and status, and wait up to ``patience`` s for both, or the wanted one.

        None stands for an answer that did not come, or for both while the line is lost; it is opened again
        meanwhile. Raises RigError when the rig was away for PATIENCE.
        """
        try:
            if self._port is None and not self._opened():
                return None, None
            assert self._port is not None
            self._lines.feed(self._port.read(0.0))  # answers that came too late
            self._port.write(lines)
            answers = self._answers(self._port, patience, wanted)
            if self._now() - self._heard > SILENCE:
                self._lose("it does not answer")
        except OSError as error:
            self._lose(str(error))
            return None, None
        return answers

    def close(self) -> None:
        """Stop the rig, make sure as far as the line allows that it heard it, and let go."""
        reason = "it does not answer"
        try:
            port, self._port = self._port or self._open(), None
            with contextlib.closing(port):
                for _ in range(STOP_TRIES):
                    port.write(command(Word.STOP) + command(Word.STATUS))
                    if self._answers(port, STOP_PATIENCE, wanted=Status)[1] is not None:
                        return
        except OSError as error:
            reason = str(error)
        _log.warning("the rig at %s did not confirm to have stopped: %s", self.name, reason)

    def _answers(
        self, port: Port, patience: float, wanted: type | None = None
    ) -> tuple[Position | None, Status | None]:
        found: dict[type | None, Answer] = {}
        end = self._now() + patience
        while not (wanted in found or len(found) == 2) and (left := end - self._now()) > 0:
            for answer in self._lines.feed(port.read(left)):
                found[type(answer)] = answer
                self._heard = self._now()
        position, status = found.get(Position), found.get(Status)
        return position if isinstance(position, Position) else None, status if isinstance(status, Status) else None

    def _opened(self) -> bool:
        now = self._now()
        if now - self._heard > PATIENCE:
            raise RigError(f"the rig at {self.name} has been away for {PATIENCE:g} s: {self._reason}")
        if now < self._retry:
            return False
        self._retry = now + RETRY
        self._port, self._lines, self._up_since = self._open(), Lines(), now
        self._port.write(command(Word.STOP))  # which also acknowledges that it braked by itself
        return True

    def _lose(self, reason: str) -> None:
        self._reason = reason
        if self._port is not None:
            _log.warning("the line to the rig at %s is lost, and opened again: %s", self.name, reason)
            self._port.close()
            self._port = None
        if self._now() - self._heard > PATIENCE:
            raise RigError(f"the rig at {self.name} has been away for {PATIENCE:g} s: {reason}")
