"""The serial port on a pseudo terminal."""

import contextlib
import errno
import fcntl
import os
import pty
import termios
import tty
from collections.abc import Iterator
from typing import Any

import pytest

from services.gantry.link import SerialPort


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A descriptor of the terminal and its name."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield slave, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_a_port_is_ours_alone_and_resets_nothing_when_it_is_closed(terminal: tuple[int, str]) -> None:
    slave, name = terminal
    attributes = termios.tcgetattr(slave)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(slave, termios.TCSANOW, attributes)
    with contextlib.closing(SerialPort(name)):
        assert not termios.tcgetattr(slave)[2] & termios.HUPCL
        with pytest.raises(OSError, match=r"exclusively lock|busy"):
            SerialPort(name)
        held = bytearray(4)
        fcntl.ioctl(slave, 0x80045440, held)  # TIOCGEXCL
        assert int.from_bytes(held, "little") == 1


def test_a_port_without_permission_names_its_group(terminal: tuple[int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", terminal[1])

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(OSError, match=f"^only the group that 'ls -lL {terminal[1]}' shows may open it$"):
        SerialPort(terminal[1])
