"""How long programs on this machine had to wait for a processor while a test ran.

The kernel counts it (pressure stall information, Documentation/accounting/psi.rst): the share of time in which at least
one program was ready to run and had no processor.
"""

import contextlib
import time
from pathlib import Path

_KERNEL = Path("/proc/pressure/cpu")


def _waited() -> float | None:
    """Seconds since the machine started; None where the kernel does not count."""
    with contextlib.suppress(OSError):
        some = _KERNEL.read_text().splitlines()[0]
        return int(some.rpartition("total=")[2]) / 1e6
    return None


class Pressure:
    """From the begin of a try on."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self._waited, self._begin = _waited(), time.monotonic()

    @property
    def share(self) -> float | None:
        waited = _waited()
        if waited is None or self._waited is None:
            return None
        return (waited - self._waited) / max(time.monotonic() - self._begin, 0.001)
