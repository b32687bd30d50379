"""A service's output: raw into its log with times, the last lines in memory, and each line to a callback."""

import asyncio
import contextlib
import os
import termios
import tty
from collections import deque
from collections.abc import Callable
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.log_times import LogTimes

_MAX_LINE = 1 << 16
_MAX_LOG = 64 << 20
_MAX_LOG_LINES = 500_000
_TAIL_LINES = 8
_TAIL_WIDTH = 300


class ServiceOutput:
    """The reading end of a pipe. ``writer`` is handed to the service; ``done`` is set at the end of its output.

    ``on_line`` is called with every line, and returns whether it is a message to the runner, and no log.
    Lines reach the log when they are complete.
    """

    def __init__(
        self, log: Path, on_line: Callable[[bytes], bool], terminal: bool = False, is_cooked: bool = False
    ) -> None:
        """With ``terminal`` it is that of a terminal, to which programs write each line at once; raises OSError.

        ``is_cooked`` means that another terminal has put a carriage return to the end of each line.
        """
        self._log = atomic.appended(log)
        self._times, self._begin = LogTimes(log), os.fstat(self._log.fileno()).st_size
        self._on_line = on_line
        self._written = self._lines = 0
        self._rest = b""
        self._skipping = False
        self._tail: deque[bytes] = deque(maxlen=_TAIL_LINES)
        self._is_cooked = is_cooked
        self._reader, self.writer = _terminal() if terminal else os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._reader, False)
        self.done = asyncio.Event()
        asyncio.get_running_loop().add_reader(self._reader, self._read)

    def release_writer(self) -> None:
        """Closes this process's copy of the writing end, so that the service's end is the output's end."""
        os.close(self.writer)

    @property
    def unfinished(self) -> bytes:
        """The start of a line whose end has not come."""
        return self._rest

    def tail(self) -> list[str]:
        return [line.decode("utf-8", "replace")[:_TAIL_WIDTH] for line in self._tail]

    def hand_over(self) -> tuple[int, int]:
        """Stops reading; returns the descriptors of pipe and log for the process that goes on."""
        asyncio.get_running_loop().remove_reader(self._reader)
        self._write(self._rest)
        self._write_times()
        return self._reader, self._log.fileno()

    def add(self, line: str) -> None:
        """Writes a line of the runner's into the log."""
        self._write(line.encode("utf-8", "replace") + b"\n")

    def close(self) -> None:
        """Reads the rest that is there already, and stops."""
        while not self.done.is_set() and self._read():
            pass
        if not self.done.is_set():
            self._finish()
        self._log.close()
        self._write_times()

    def _read(self) -> bool:
        """Reads once; whether there was something to read."""
        try:
            data = os.read(self._reader, 1 << 16)
        except BlockingIOError:
            return False
        except OSError:  # the end of a terminal that no program has open any more
            data = b""
        if not data:
            self._finish()
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        if self._is_cooked:
            lines = [line.removesuffix(b"\r") for line in lines]
        self._write(b"".join(line + b"\n" for line in lines if self._take(line)))
        if len(self._rest) > _MAX_LINE:
            if not self._skipping:
                self._tail.append(self._rest[:_TAIL_WIDTH])
            self._write(self._rest)
            self._skipping, self._rest = True, b""
        return True

    def _write(self, data: bytes) -> None:
        """Writes to the log up to its limit; messages to the runner count beyond it, too."""
        if self._written > _MAX_LOG or not data:
            return
        self._lines += data.count(b"\n")
        if self._written + len(data) > _MAX_LOG or self._lines > _MAX_LOG_LINES:
            limit = f"{_MAX_LOG_LINES} lines" if self._lines > _MAX_LOG_LINES else f"{_MAX_LOG >> 20} MiB"
            data = f"\n... dodo: the log ends here, at {limit}\n".encode()
            self._written = _MAX_LOG
        self._times.note(self._begin + self._written)
        self._written += len(data)
        try:
            self._log.write(data)
        except OSError as error:
            self._written = _MAX_LOG + 1
            self._tail.append(f"... dodo: the log cannot be written: {error.strerror}".encode())

    def _take(self, line: bytes) -> bool:
        """Whether a line belongs into the log."""
        if self._skipping:
            self._skipping = False
            return True
        if not line.strip():
            return True
        if self._on_line(line):
            return False
        self._tail.append(line)
        return True

    def _finish(self) -> None:
        asyncio.get_running_loop().remove_reader(self._reader)
        os.close(self._reader)
        if self._rest and self._take(self._rest):
            self._write(self._rest)
        self.done.set()

    def _write_times(self) -> None:
        with contextlib.suppress(OSError):  # the log counts without them, too
            self._times.write()


def _terminal() -> tuple[int, int]:
    """Both ends of a pseudo terminal that changes and repeats nothing; raises OSError."""
    reader, writer = os.openpty()
    try:
        tty.setraw(writer, termios.TCSANOW)
    except termios.error as error:
        os.close(reader)
        os.close(writer)
        raise OSError(*error.args) from None
    return reader, writer
