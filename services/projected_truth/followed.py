"""The sample times of the pictures that another program shares."""

from dodo_dsl.opendlv.memory.shared_memory import SharedMemory, SharedMemoryError

_PATIENCE = 0.02
"""s to wait for the memory's lock."""
_RETRY = 100_000
"""us after which a memory that was not there is looked for again."""


class FollowedMemory:
    """Polls a shared memory and never waits for a notification, so that a camera that counts readers sees none.

    What is in it at first is skipped, as it may not be a picture yet.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._memory: SharedMemory | None = None
        self._last = 0
        self._retry = 0

    def new(self, now: int) -> int | None:
        """The sample time of the picture in it, in us, if that was not told yet."""
        try:
            if self._memory is None:
                self._attach(now)
                return None
            with self._memory.lock(_PATIENCE):
                time = self._memory.sample_time()
        except SharedMemoryError:
            if self._memory is None or not self._memory.is_there:
                self.close()
                self._retry = now + _RETRY
            return None
        if time == self._last:
            return None
        self._last = time
        return time

    def _attach(self, now: int) -> None:
        if now < self._retry:
            return
        self._memory = SharedMemory.attach(self._name)
        with self._memory.lock(_PATIENCE):
            self._last = self._memory.sample_time()

    def close(self) -> None:
        """Detaches from the memory."""
        if self._memory is not None:
            self._memory.close()
            self._memory = None
