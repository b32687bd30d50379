"""Signals while a service is being built, which may wait for hardware."""

import contextlib
import signal
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
