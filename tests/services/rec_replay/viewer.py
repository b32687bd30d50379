"""A reader of shared memory as applications are: waits for each picture and keeps what it saw."""

import threading
import time
from contextlib import suppress
from types import TracebackType
from typing import Self

from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

PATIENCE = 20.0


class Viewer:
    """A context manager; `seen` holds the bytes and the sample time of each picture."""

    def __init__(self, name: str) -> None:
        self.seen: list[tuple[bytes, int]] = []
        self._over = False
        self._memory = self._attached(name)
        self._thread = threading.Thread(target=self._watch)

    def wait_for(self, count: int) -> None:
        deadline = time.monotonic() + PATIENCE
        while len(self.seen) < count:
            assert time.monotonic() < deadline, f"{len(self.seen)} of {count} pictures came"
            time.sleep(0.005)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over = True
        self._thread.join()
        self._memory.close()

    @staticmethod
    def _attached(name: str) -> SharedMemory:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            with suppress(SharedMemoryError):
                return SharedMemory.attach(name)
            time.sleep(0.01)
        raise AssertionError(f"there is no memory {name}")

    def _watch(self) -> None:
        """Looks after each wait: who is told between two of them is not told again."""
        with suppress(SharedMemoryError):
            last = self._sampled(0)
            while not self._over:
                self._memory.wait(0.02)
                last = self._sampled(last)

    def _sampled(self, last: int) -> int:
        """The sample time of the picture that is there now, which is kept if it is another one than the ``last``."""
        with self._memory.lock():
            sampled = self._memory.sample_time()
            if last and sampled != last:
                self.seen.append((bytes(self._memory.buffer), sampled))
        return sampled
