"""Shared memory in lockstep: a picture is told of when the clock says so, and when its readers wait for it."""

import time
from collections.abc import Callable

from dodo_dsl.opendlv.memory import SharedMemory

_LOOK = 0.0002
_LONGEST_LOOK = 0.002


class AnnouncedMemory(SharedMemory):
    """Shared memory that keeps the news of a picture until it is told to announce it."""

    is_new = False
    sampled = 0
    """When the picture was sampled, in microseconds since the epoch."""

    def stamp(self, time_us: int) -> None:
        super().stamp(time_us)
        self.sampled = time_us

    def notify_all(self) -> None:
        """There is a new picture; its readers will be told by ``announce``."""
        self.is_new = True

    def announce(self) -> None:
        """Tell the readers."""
        self.is_new = False
        super().notify_all()


class Screen:
    """All the memories of a service; ``readers`` are expected to wait for pictures of all of them together."""

    def __init__(self, readers: int) -> None:
        self._readers = readers
        self.memories: list[AnnouncedMemory] = []

    @property
    def new(self) -> list[AnnouncedMemory]:
        """Those that hold a picture of which nobody was told."""
        return [memory for memory in self.memories if memory.is_new]

    @property
    def sampled(self) -> int:
        """When the newest picture was sampled."""
        return max((memory.sampled for memory in self.memories), default=0)

    def await_readers(self, stopped: Callable[[], bool]) -> bool:
        """Until all readers wait, so that none misses a picture or reads one twice; False when ``stopped``.

        The kernel wakes nobody when a process begins to wait, so this looks, less and less often.
        """
        look = _LOOK
        while sum(memory.readers_waiting() for memory in self.memories) < self._readers:
            if stopped():
                return False
            time.sleep(look)
            look = min(look * 1.2, _LONGEST_LOOK)
        return True

    def announce(self) -> None:
        """Tell of all that is new."""
        for memory in self.new:
            memory.announce()
