"""A service's output: raw into its log with times, the last lines in memory, and each line to a callback.

Where lines are messages, they go to another thread instead, and nothing more is read until it has them all behind it.
"""

import asyncio
import contextlib
import os
import re
import termios
import tty
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.log_times import LogTimes

_MAX_LINE = 1 << 16
_MAX_LOG = 64 << 20
_MAX_LOG_LINES = 500_000
TAIL_LINES = 8
TAIL_WIDTH = 300
_FULL = 1 << 12
"""Bytes that a terminal holds; a program that has printed as many may sleep only because it has to wait."""
_ENOUGH = 1 << 14
_ECHO_S = 10.0
REPRINT = b"\x12"
"""What a terminal, asked for its unfinished line, answers with ``_REPRINTED``, and gives to no program (termios(3))."""
_REPRINTED = re.compile(rb"\^R\r?\n")

Match = Callable[[Sequence[bytes]], Coroutine[Any, Any, None]]


class ServiceOutput:
    """The reading end of a pipe. ``writer`` is handed to the service; ``done`` is set at the end of its output.

    ``on_line`` is called with every line, and returns whether it is a message to the runner, and no log.
    Lines reach the log when they are complete.
    """

    def __init__(
        self,
        log: Path,
        on_line: Callable[[bytes], bool],
        terminal: bool = False,
        is_cooked: bool = False,
        match: Match | None = None,
    ) -> None:
        """With ``terminal`` it is that of a terminal, to which programs write each line at once; raises OSError.

        ``is_cooked`` means that another terminal has put a carriage return to the end of each line.
        """
        self.type_in: Callable[[bytes], None] | None = None
        """Types into another terminal, whose output comes here some time after it was printed."""
        self._match = match
        self._matching: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._matching.set_result(None)
        self._read_bytes, self._echoes = 0, asyncio.Semaphore(0)
        self._log = atomic.appended(log)
        self._times, self._begin = LogTimes(log), os.fstat(self._log.fileno()).st_size
        self._on_line = on_line
        self._written = self._lines = 0
        self._rest = self._handed = b""
        self._skipping = False
        self._tail: deque[bytes] = deque(maxlen=TAIL_LINES)
        self._is_cooked = is_cooked
        self._reader, self.writer = _terminal() if terminal else os.pipe2(os.O_CLOEXEC)
        os.set_blocking(self._reader, False)
        self.done = asyncio.Event()
        asyncio.get_running_loop().add_reader(self._reader, self._read)

    def release_writer(self) -> None:
        """Closes this process's copy of the writing end, so that the service's end is the output's end."""
        os.close(self.writer)

    def tail(self) -> list[str]:
        return [line.decode("utf-8", "replace")[:TAIL_WIDTH] for line in self._tail]

    def hand_over(self) -> tuple[int, int]:
        """Stops reading; returns the descriptors of pipe and log for the process that goes on."""
        self._match = None
        asyncio.get_running_loop().remove_reader(self._reader)
        self._write(self._rest)
        self._write_times()
        return self._reader, self._log.fileno()

    def add(self, line: str) -> None:
        self._write(line.encode("utf-8", "replace") + b"\n")

    def close(self) -> None:
        """Reads the rest that is there already, and stops."""
        self._match = None
        while self._reader >= 0 and self._read():
            pass
        if self._reader >= 0:
            self._finish()
        self.done.set()
        self._log.close()
        self._write_times()

    def _read(self) -> bool:
        try:
            data = os.read(self._reader, 1 << 16)
        except BlockingIOError:
            return False
        except OSError:  # the end of a terminal that no program has open any more
            data = b""
        if not data:
            self._finish()
            return False
        self._read_bytes += len(data)
        data = self._rest + data
        if self.type_in is not None:
            data, echoes = _REPRINTED.subn(b"", data)
            for _ in range(echoes):
                self._echoes.release()
        *lines, self._rest = data.split(b"\n")
        if self._is_cooked:
            lines = [line.removesuffix(b"\r") for line in lines]
        if lines and self._handed:  # as a line without its end: it does not count once more
            is_handed, self._handed = lines[0].rstrip(b"\r") == self._handed, b""
            self._hand(lines[1:] if is_handed else lines)
        else:
            self._hand(lines)
        self._write(b"".join(line + b"\n" for line in lines if self._take(line)))
        if len(self._rest) > _MAX_LINE:
            if not self._skipping:
                self._tail.append(self._rest[:TAIL_WIDTH])
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
        self._reader = -1
        if self._rest:
            self._hand([self._rest] if self._rest != self._handed else [])
            if self._take(self._rest):
                self._write(self._rest)
        if self._matching.done():
            self.done.set()

    def _hand(self, lines: Sequence[bytes]) -> None:
        """Has lines matched; until then, nothing is read."""
        if self._match is None or not lines:
            return
        if self._reader >= 0:
            asyncio.get_running_loop().remove_reader(self._reader)
        self._matching = asyncio.ensure_future(self._match(lines))
        self._matching.add_done_callback(self._read_on)

    def _read_on(self, _: object) -> None:
        if self._match is None or self.done.is_set():
            return
        if self._reader < 0:
            self.done.set()
        else:
            asyncio.get_running_loop().add_reader(self._reader, self._read)

    async def read_empty(self) -> bool:
        """Has all matched that was printed until now, and a line without its end, as its program rests.

        Whether so much came that the program may only wait for room in the terminal. Raises TimeoutError where another
        terminal says nothing.
        """
        if self.type_in is not None:
            await self._hear_echo(self.type_in)
        while await self._is_matched() and self.type_in is None and self._read_bytes < _ENOUGH and self._read():
            pass
        is_full, self._read_bytes = self._read_bytes >= _FULL, 0
        if await self._is_matched() and self._rest not in (b"", self._handed) and not (is_full or self._skipping):
            self._handed = self._rest
            self._hand([self._rest])
            await self._is_matched()
        return is_full

    async def _is_matched(self) -> bool:
        """Waits for what is matched already; whether more can come."""
        await asyncio.wait([self._matching])
        return self._match is not None and self._reader >= 0

    async def _hear_echo(self, type_in: Callable[[bytes], None]) -> None:
        type_in(REPRINT)
        waits = [asyncio.ensure_future(each) for each in (self._echoes.acquire(), self.done.wait())]
        done, _ = await asyncio.wait(waits, timeout=_ECHO_S, return_when=asyncio.FIRST_COMPLETED)
        for each in waits:
            each.cancel()
        if not done:
            raise TimeoutError

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
