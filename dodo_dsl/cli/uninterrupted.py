"""What lets a run reach its end and report: signals, closed pipes, and limits of this process."""

import contextlib
import os
import resource
import signal
from collections.abc import Iterable, Iterator
from typing import Any, TextIO

from dodo_dsl.terminal import unescaped


def more_descriptors() -> None:
    """Raises the limit of descriptors as far as allowed: every service has a pipe and a log."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Ignores Ctrl-C and signals, so that existing results are written."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, signal.SIG_IGN) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@contextlib.contextmanager
def signals_interrupt() -> Iterator[None]:
    """SIGTERM and SIGHUP are as Ctrl-C while this lasts, and afterwards what they were."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        for number in before:
            signal.signal(number, stop_like_interrupt)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class UninterruptedStream:
    """A stream whose reader may leave (``dodo run | head``) without an end to the run."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._broken = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @property
    def unescaped(self) -> "UninterruptedStream":
        """The stream for displays that move the cursor, without an end of the run either."""
        return UninterruptedStream(unescaped(self._stream))

    def write(self, text: str) -> int:
        try:
            return 0 if self._broken else self._stream.write(text)
        except OSError:
            return self._give_up()

    def writelines(self, lines: Iterable[str]) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        try:
            if not self._broken:
                self._stream.flush()
        except OSError:
            self._give_up()

    def _give_up(self) -> int:
        self._broken = True
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        return 0


def stop_like_interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt
