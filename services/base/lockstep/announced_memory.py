"""Shared memory in lockstep: a picture is announced when the clock says so and all its readers wait."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dodo_dsl.opendlv.memory.posix_segment import PosixSegment
from dodo_dsl.opendlv.memory.shared_memory import LOCK_PATIENCE, SharedMemory
from dodo_dsl.opendlv.memory.sysv_segment import Segment

_POLL_S = 0.0002
_LONGEST_POLL_S = 0.002


class AnnouncedMemory(SharedMemory):
    """Shared memory that holds back the next picture until it is announced, so that nobody reads it too early.

    ``sampled`` is when that picture was sampled, in microseconds since the epoch.
    """

    def __init__(self, segment: Segment | PosixSegment, name: str, owner: bool) -> None:
        super().__init__(segment, name, owner)
        self._shown = self.buffer
        self.buffer = memoryview(bytearray(self.size))
        self.is_new = False
        self.sampled = 0

    @contextmanager
    def lock(self, timeout: float = LOCK_PATIENCE) -> Iterator[None]:
        """No lock is needed: nobody else sees the next picture."""
        yield

    def stamp(self, time_us: int) -> None:
        self.sampled = time_us

    def notify_all(self) -> None:
        """There is a new picture; ``announce`` will notify its readers."""
        self.is_new = True

    def announce(self) -> None:
        """Show the picture and notify the readers."""
        self.is_new = False
        with super().lock():
            self._shown[:] = self.buffer
            super().stamp(self.sampled)
            super().notify_all()

    def close(self) -> None:
        self._shown = memoryview(b"")
        super().close()


class Announcer:
    """All the memories of a service; ``readers`` are expected to wait for pictures of all of them together."""

    def __init__(self, readers: int) -> None:
        self._readers = readers
        self.memories: list[AnnouncedMemory] = []

    @property
    def new(self) -> list[AnnouncedMemory]:
        """Those that hold a picture that is not announced yet."""
        return [memory for memory in self.memories if memory.is_new]

    @property
    def sampled(self) -> int:
        """When the newest picture was sampled."""
        return max((memory.sampled for memory in self.memories), default=0)

    def await_readers(self, stopped: Callable[[], bool]) -> bool:
        """Wait until all readers wait, so that none misses a picture or reads one twice; False when ``stopped``.

        The kernel gives no notice when a process begins to wait, so this polls, less and less often.
        """
        pause = _POLL_S
        while sum(memory.readers_waiting() for memory in self.memories) < self._readers:
            if stopped():
                return False
            time.sleep(pause)
            pause = min(pause * 1.2, _LONGEST_POLL_S)
        return True

    def announce(self) -> None:
        """Announce all new pictures."""
        for memory in self.new:
            memory.announce()
