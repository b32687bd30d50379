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
def _handled(numbers: Iterable[signal.Signals], handler: Any) -> Iterator[None]:
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def undisturbed() -> contextlib.AbstractContextManager[None]:
    """Ignores Ctrl-C and signals, so that existing results are written."""
    return _handled((signal.SIGINT, signal.SIGTERM, signal.SIGHUP), signal.SIG_IGN)


def signals_interrupt() -> contextlib.AbstractContextManager[None]:
    """SIGTERM and SIGHUP are as Ctrl-C while this lasts, and afterwards what they were."""
    return _handled((signal.SIGTERM, signal.SIGHUP), stop_like_interrupt)


class UninterruptedStream:
    """A stream whose reader may leave (``dodo run | head``) without an end to the run."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @property
    def unescaped(self) -> "UninterruptedStream":
        """The stream for displays that move the cursor, without an end of the run either."""
        return UninterruptedStream(unescaped(self._stream))

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError:
            self._give_up()
            return 0

    def writelines(self, lines: Iterable[str]) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError:
            self._give_up()

    def _give_up(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


def stop_like_interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt
