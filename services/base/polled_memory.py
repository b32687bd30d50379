"""A shared memory that is looked at from time to time, by a service that is none of its readers."""

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

RETRY = 100_000
"""us after which a memory that was not there is looked for again."""
Found = TypeVar("Found")
_log = logging.getLogger(__name__)


class PolledMemory:
    """Never waits for a notification, so that a camera that counts its readers does not see it.

    What is in it at first is passed over, as it may not be a picture yet, unless ``is_first_taken``. ``patience`` is in
    s, for its lock.
    """

    def __init__(self, name: str, patience: float, is_first_taken: bool = False) -> None:
        self.name, self.last = name, 0
        self._patience, self._is_first_taken = patience, is_first_taken
        self._memory: SharedMemory | None = None
        self._retry, self._is_known = 0, False

    def poll(self, now: int, take: Callable[[SharedMemory, int], Found | None]) -> Found | None:
        """What ``take`` makes of the locked memory and its sample time, in us as ``now``; None if it cannot be had."""
        if self._memory is None and now < self._retry:
            return None
        try:
            memory = self._memory = self._memory or SharedMemory.attach(self.name)
            with memory.lock(self._patience):
                time = memory.sample_time()
                if not self._is_known:
                    self._is_known = True
                    self.pass_over(0 if self._is_first_taken else time)
                return take(memory, time)
        except SharedMemoryError as error:
            _log.debug("no picture of '%s': %s", self.name, error)
            if self._memory is None or not self._memory.is_there:
                self.close()
                self._retry = now + RETRY
            return None

    def skip(self) -> None:
        if self._memory is not None:
            with suppress(SharedMemoryError), self._memory.lock(self._patience):
                self.pass_over(self._memory.sample_time())

    def pass_over(self, time: int) -> None:
        """The picture of this sample time is not wanted."""
        self.last = time

    def close(self) -> None:
        if self._memory is not None:
            self._memory.close()
            self._memory, self._is_known = None, False
