"""The line to the rig's Arduino, a serial port: found first, then supervised, and never left without a stop."""

import contextlib
import errno
import fcntl
import logging
import os
import select
import termios
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import serial

from services.gantry.motion import Conversion
from services.gantry.protocol import LATCHED, Limits, LineReader, Position, Refusal, Word, command
from services.gantry.rig_table import BAUD, Status

WRITE_PATIENCE = 0.2


class PortError(ValueError):
    """A port that cannot be used; one sentence."""


class SerialPort:
    """A port of pyserial that never waits longer than requested."""

    def __init__(self, target: str) -> None:
        """Raises OSError when the device cannot be opened."""
        try:
            self._port = serial.Serial(target, BAUD, timeout=0, write_timeout=WRITE_PATIENCE, exclusive=True)
        except termios.error as error:
            raise OSError(f"{target} is not a serial port: {error.args[-1]}") from None
        except serial.SerialException as error:
            if error.errno == errno.EACCES:
                raise OSError(f"only the group that 'ls -lL {target}' shows may open it") from None
            raise
        _keep(target, self._port)

    def write(self, data: bytes) -> None:
        """Send all bytes; raises OSError when the line is lost, and so does reading."""
        with _as_os_errors():
            self._port.write(data)

    def read(self, timeout: float) -> bytes:
        """What is there, or what comes first within ``timeout`` seconds; empty when nothing does."""
        with _as_os_errors():
            if not select.select([self._port.fileno()], [], [], max(timeout, 0.0))[0]:
                return b""
            return bytes(self._port.read(max(1, self._port.in_waiting)))

    def close(self) -> None:
        with contextlib.suppress(OSError, termios.error):
            self._port.close()


def checked(target: str) -> str:
    """A target that is a device; raises PortError."""
    if not target.startswith("/") or not os.path.realpath(target).startswith("/dev/"):
        raise PortError(f"'{target}' is not a device, expected one such as /dev/ttyACM0")
    if not Path(target).is_char_device():
        raise PortError(f"there is no serial port {target}; is the rig plugged in?")
    return target


@contextlib.contextmanager
def _as_os_errors() -> Iterator[None]:
    try:
        yield
    except (termios.error, TypeError, ValueError) as error:
        raise OSError(f"the port is gone: {error}") from None


def _keep(target: str, port: serial.SerialBase) -> None:
    """Nobody else can open the device, not even from a container, where pyserial's lock on the file has no effect.

    DTR stays up when the port is closed: its fall and rise would reset the Arduino.
    """
    try:
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
        attributes = termios.tcgetattr(port.fileno())
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)
    except (OSError, termios.error) as error:
        _log.warning("%s may reset the rig when it is closed, and is not locked: %s", target, error)


SILENCE = 1.0
"""s without an answer after which a line counts as lost."""
PATIENCE = 5.0
"""s that a rig has to answer at first: an Arduino that was plugged in needs two."""
STOP_TRIES, STOP_PATIENCE = 3, 0.2
REQUEST_STATE = command(Word.POSITION) + command(Word.STATUS)

_log = logging.getLogger(__name__)


class RigError(RuntimeError):
    """The rig cannot go on; one sentence."""


class LinkAnswers(NamedTuple):
    at: Position | None = None
    status: Status | None = None
    refusals: tuple[Refusal, ...] = ()
    limits: Limits | None = None


class Link:
    """Commands the rig over a line that it opens. It sends nothing on its own, so that a fault can be read first."""

    def __init__(self, name: str, conversion: Conversion | None = None) -> None:
        """Positions that it gives are true ones. Raises PortError when the line cannot be opened."""
        self.name = name
        self.conversion = conversion or Conversion()
        try:
            self._port: SerialPort | None = SerialPort(name)
        except OSError as error:
            reason = error.strerror or error
            raise PortError(f"the line to the rig at {name} cannot be opened: {reason}") from None
        self._lines = LineReader()
        self._last_state = time.monotonic()
        self._found = False
        self._status: Status | None = None

    def exchange(self, lines: bytes, patience: float) -> LinkAnswers:
        """Send commands of which STATUS is the last, and wait up to ``patience`` s for its answer.

        Raises RigError when the line is lost, or silent for SILENCE, or for PATIENCE before its first answer.
        """
        try:
            if self._port is None:
                raise OSError("it was lost before")  # noqa: TRY301
            late = self._lines.feed(self._port.read(0.0))
            if lines != REQUEST_STATE:
                self._status = None
            self._port.write(lines)
            answers = self._answers(self._port, patience)
        except OSError as error:
            if self._port is not None:
                self._port.close()
                self._port = None
            raise RigError(f"the line to the rig at {self.name} is lost: {error.strerror or error}") from None
        silence = time.monotonic() - self._last_state
        if self._found and silence > SILENCE:
            raise RigError(f"the line to the rig at {self.name} is lost: it does not answer")
        if silence > PATIENCE:
            raise RigError(f"the rig at {self.name} gave no answer for {PATIENCE:g} s")
        return answers._replace(refusals=(*(a for a in late if isinstance(a, Refusal)), *answers.refusals))

    def close(self) -> None:
        """Stop the rig and close the line; one that a fault has stopped is left alone: STOP would erase the fault."""
        reason = "it does not answer"
        try:
            port, self._port = self._port or SerialPort(self.name), None
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

    def _answers(self, port: SerialPort, patience: float) -> LinkAnswers:
        at, status, limits, refusals = None, None, None, []
        end = time.monotonic() + patience
        while status is None and (left := end - time.monotonic()) > 0:
            for answer in self._lines.feed(port.read(left)):
                self._last_state, self._found = time.monotonic(), True
                if isinstance(answer, Position):
                    at = self.conversion.to_true(answer)
                elif isinstance(answer, Status):
                    status = self._status = answer
                elif isinstance(answer, Limits):
                    limits = answer
                else:
                    refusals.append(answer)
        return LinkAnswers(at, status, tuple(refusals), limits)
