"""A service's output: raw into its log with times, the last lines in memory, lines of the protocol to a callback."""

import asyncio
import contextlib
import os
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

    ``on_line`` is called with every line, and returns whether it belongs to the protocol and not to the log.
    """

    def __init__(self, log: Path, on_line: Callable[[bytes], bool]) -> None:
        self._log = atomic.appended(log)
        self._times, self._begin = LogTimes(log), os.fstat(self._log.fileno()).st_size
        self._on_line = on_line
        self._written = self._lines = 0
        self._rest = b""
        self._skipping = False
        self._tail: deque[bytes] = deque(maxlen=_TAIL_LINES)
        self._reader, self.writer = os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._reader, False)
        self.done = asyncio.Event()
        asyncio.get_running_loop().add_reader(self._reader, self._read)

    def release_writer(self) -> None:
        """Closes this process's copy of the writing end, so that the service's end is the output's end."""
        os.close(self.writer)

    def tail(self) -> list[str]:
        return [line.decode("utf-8", "replace")[:_TAIL_WIDTH] for line in self._tail]

    def hand_over(self) -> tuple[int, int]:
        """Stops reading; returns the descriptors of pipe and log for the process that goes on."""
        asyncio.get_running_loop().remove_reader(self._reader)
        self._write_times()
        return self._reader, self._log.fileno()

    def close(self) -> None:
        """Reads the rest that is there already, and stops."""
        while not self.done.is_set() and self._read():
            pass
        if not self.done.is_set():
            self._finish()

    def _read(self) -> bool:
        """Reads once; whether there was something to read."""
        try:
            data = os.read(self._reader, 1 << 16)
        except BlockingIOError:
            return False
        if not data:
            self._finish()
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._take(line)
        if len(self._rest) > _MAX_LINE:
            if not self._skipping:
                self._tail.append(self._rest[:_TAIL_WIDTH])
            self._skipping, self._rest = True, b""
        self._write(data)
        return True

    def _write(self, data: bytes) -> None:
        """Writes to the log up to its limit; lines of the protocol count beyond it, too."""
        if self._written > _MAX_LOG:
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

    def _take(self, line: bytes) -> None:
        if self._skipping:
            self._skipping = False
            return
        if line.strip() and not self._on_line(line):
            self._tail.append(line)

    def _finish(self) -> None:
        asyncio.get_running_loop().remove_reader(self._reader)
        os.close(self._reader)
        if self._rest:
            self._take(self._rest)
        self._log.close()
        self._write_times()
        self.done.set()

    def _write_times(self) -> None:
        with contextlib.suppress(OSError):  # the log counts without them, too
            self._times.write()
