"""Shared memory as libcluon lays it out in its SysV mode: how the frames of a camera travel.

A segment without header holds the data; one semaphore is the mutex (1 is free), another the condition (1 is idle,
0 wakes all that wait). The time stamp of the content is the token file's time of modification.
"""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Self

import sysv_ipc

from dodo_dsl.opendlv import tokenfile
from dodo_dsl.opendlv.segment import Segment
from dodo_dsl.opendlv.semaphore import Result, operate
from dodo_dsl.opendlv.tokenfile import SharedMemoryError

__all__ = ["SharedMemory", "SharedMemoryError"]

LOCK_PATIENCE = 5.0


class SharedMemory:
    """A named piece of memory; a context manager. Made by `create` (the writer) or `attach` (a reader).

    `size` is in bytes, `buffer` a writable view of them all; take the lock to use it. Views and arrays of it stay
    valid after `close`.
    """

    def __init__(self, segment: Segment, name: str, owner: bool) -> None:
        self.name = name
        self.size: int = segment.memory.size
        self.buffer = segment.view()
        self._segment = segment
        self._owner = owner
        self._locked = False
        self._closed = False

    @classmethod
    def create(cls, name: str, size: int) -> Self:
        """Make memory of `size` bytes, all zero, and what belongs to it; `close` removes it all.

        What a dead creator left under this name is removed first. Raises SharedMemoryError, also where a living
        process holds memory of this name.
        """
        _refuse_posix()
        if not 0 < size < 2**32:
            raise SharedMemoryError(f"shared memory `{name}` cannot have {size} bytes")
        return cls(Segment.create(tokenfile.path_of(name), size), name, owner=True)

    @classmethod
    def attach(cls, name: str) -> Self:
        """Use the memory that another process made; raises SharedMemoryError where there is none."""
        _refuse_posix()
        return cls(Segment.attach(tokenfile.path_of(name)), name, owner=False)

    @contextmanager
    def lock(self, timeout: float = LOCK_PATIENCE) -> Iterator[None]:
        """Hold the mutex; raises SharedMemoryError when another holds it for `timeout` seconds."""
        deadline = time.monotonic() + timeout
        while (result := self._operate(self._segment.mutex, -1, deadline - time.monotonic())) is not Result.DONE:
            if result is Result.TIMEOUT:
                raise SharedMemoryError(f"shared memory `{self.name}` was locked by another for {timeout:g} s")
        self._locked = True
        try:
            yield
        finally:
            self._locked = False
            self._operate(self._segment.mutex, 1, None)

    def stamp(self, time_us: int) -> None:
        """Say when the content was sampled (microseconds since the epoch); only while locked."""
        self._need_lock()
        accessed = os.fstat(self._segment.token).st_atime_ns
        os.utime(self._segment.token, ns=(accessed, time_us * 1000))

    def sample_time(self) -> int:
        """When the content was sampled (microseconds since the epoch); only while locked."""
        self._need_lock()
        return os.fstat(self._segment.token).st_mtime_ns // 1000

    def notify_all(self) -> None:
        """Wake all processes that wait now, each once.

        It happens under the lock: a quick reader would else come back while the condition is still 0 and read the
        same content again. Raises SharedMemoryError as `lock` does.
        """
        if self._locked:
            self._wake()
            return
        with self.lock():
            self._wake()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for a notification: False when `timeout` seconds are over or a signal came.

        Raises SharedMemoryError when the creator has removed the memory.
        """
        return self._operate(self._segment.condition, 0, timeout) is Result.DONE

    def readers_waiting(self) -> int:
        """How many processes wait for a notification at this moment."""
        try:
            return int(self._segment.condition.waiting_for_zero)
        except sysv_ipc.Error:
            raise self._removed() from None

    def close(self) -> None:
        """Let go; the creator wakes all that wait and removes everything."""
        if self._closed:
            return
        self._closed = True
        self.buffer = memoryview(b"")
        if self._owner:
            with suppress(SharedMemoryError):
                self._wake()
            self._segment.remove()
        self._segment.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _wake(self) -> None:
        try:
            self._segment.condition.value = 0
            self._segment.condition.value = 1
        except sysv_ipc.Error:
            raise self._removed() from None

    def _operate(self, semaphore: sysv_ipc.Semaphore, value: int, timeout: float | None) -> Result:
        try:
            return operate(semaphore.id, value, timeout, undo=value != 0)
        except OSError:
            raise self._removed() from None

    def _need_lock(self) -> None:
        if not self._locked:
            raise SharedMemoryError(f"shared memory `{self.name}` must be locked for its time stamp")

    def _removed(self) -> SharedMemoryError:
        return SharedMemoryError(f"shared memory `{self.name}` was removed by its creator")


def _refuse_posix() -> None:
    if os.environ.get("CLUON_SHAREDMEMORY_POSIX", "").startswith("1"):
        raise SharedMemoryError("CLUON_SHAREDMEMORY_POSIX=1 is set, but only SysV shared memory is supported")
