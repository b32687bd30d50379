"""Signals while a service is being built, which may wait for hardware."""

import contextlib
import os
import signal
import stat
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """A signal ends the service at once with code 0, and closes its resources; only in the main thread."""

    def leave(_number: int, _frame: object) -> None:
        raise SystemExit(0)

    old = {number: signal.signal(number, leave) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def stop_without_master() -> None:
    """From now on the end of standard input, where it is a pipe, is a SIGTERM: the process that held it has ended."""
    if stat.S_ISFIFO(os.fstat(0).st_mode):
        threading.Thread(target=_await_end, daemon=True).start()


def _await_end() -> None:
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
