"""The serial port to the rig's Arduino."""

import contextlib
import errno
import fcntl
import grp
import logging
import os
import pwd
import re
import select
import shlex
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import serial

from services.gantry.protocol import BAUD

WRITE_PATIENCE = 0.2

_log = logging.getLogger(__name__)
_SOCKET = re.compile(r"socket://(127\.0\.0\.1|localhost|\[::1\]):[0-9]{1,5}")


class PortError(ValueError):
    """A port that cannot be used; one sentence."""


class SerialLine(Protocol):
    """A line of bytes; both raise OSError when it is lost."""

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        ...

    def read(self, timeout: float) -> bytes:
        """What is there, or what comes first within ``timeout`` seconds; empty when nothing does."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


class SerialPort:
    """A port of pyserial that never waits longer than requested."""

    def __init__(self, target: str) -> None:
        """``target`` is a device, or a socket of this machine; raises OSError when it cannot be opened."""
        exclusive = None if _SOCKET.fullmatch(target) else True
        try:
            self._port = serial.serial_for_url(
                target, BAUD, timeout=0, write_timeout=WRITE_PATIENCE, exclusive=exclusive
            )
        except termios.error as error:
            raise OSError(f"{target} is not a serial port: {error.args[-1]}") from None
        except serial.SerialException as error:
            if error.errno == errno.EACCES:
                raise OSError(_refusal(Path(target).stat())) from None
            raise
        _keep(target, self._port)

    def write(self, data: bytes) -> None:
        with _as_os_errors():
            self._port.write(data)

    def read(self, timeout: float) -> bytes:
        with _as_os_errors():
            if not select.select([self._port.fileno()], [], [], max(timeout, 0.0))[0]:
                return b""
            return bytes(self._port.read(max(1, self._port.in_waiting)))

    def close(self) -> None:
        with contextlib.suppress(OSError, termios.error):
            self._port.close()


def checked(target: str) -> str:
    """A target that may be opened: a device, or a socket of this machine; raises PortError.

    Other URLs of pyserial are refused, as some of them write files or listen.
    """
    if "://" in target:
        if _SOCKET.fullmatch(target):
            return target
        raise PortError(f"'{target}' is not a port of the rig, expected a device or socket://127.0.0.1:PORT")
    if not target.startswith("/") or not os.path.realpath(target).startswith("/dev/"):
        raise PortError(f"'{target}' is not a device, expected one such as /dev/ttyACM0")
    if not Path(target).is_char_device():
        raise PortError(f"there is no serial port {target}; is the rig plugged in?")
    return target


@contextlib.contextmanager
def _as_os_errors() -> Iterator[None]:
    """Errors of a port that went away, as OSError."""
    try:
        yield
    except (termios.error, TypeError, ValueError) as error:
        raise OSError(f"the port is gone: {error}") from None


def _refusal(device: os.stat_result) -> str:
    """Why a device is not opened, and how this user gets into the group that may, where there is one beside root's."""
    said = "this user may not open it"
    if device.st_mode & 0o060 != 0o060 or device.st_gid == 0:
        return said
    try:
        group, user = grp.getgrgid(device.st_gid), pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return said
    if user in group.gr_mem:
        return f"{said}, as its session is older than its place in the group '{group.gr_name}': log in anew"
    return f"{said}: sudo {shlex.join(['usermod', '--append', '--groups', group.gr_name, user])}, and log in anew"


def _keep(target: str, port: serial.SerialBase) -> None:
    """Nobody else can open the device, not even from a container, where pyserial's lock on the file has no effect.

    DTR stays up when the port is closed: its fall and rise would reset the Arduino.
    """
    if _SOCKET.fullmatch(target):
        return
    try:
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
        attributes = termios.tcgetattr(port.fileno())
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)
    except (OSError, termios.error) as error:
        _log.warning("%s may reset the rig when it is closed, and is not locked: %s", target, error)
