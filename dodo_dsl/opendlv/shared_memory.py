"""Shared memory in both modes of libcluon: how the frames of a camera travel.

SysV is the default: a segment without header holds the data, semaphores are mutex and condition, and the time of the
content is that of the token file in /tmp. CLUON_SHAREDMEMORY_POSIX=1 selects POSIX: one object holds all of it.
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Self

from dodo_dsl.opendlv import posix_memory, sysv_memory
from dodo_dsl.opendlv.posix_memory import PosixSegment
from dodo_dsl.opendlv.sysv_memory import Segment, SharedMemoryError

__all__ = ["MemoryTakenError", "SharedMemory", "SharedMemoryError"]

LOCK_PATIENCE = 5.0
MODE = "CLUON_SHAREDMEMORY_POSIX"


class MemoryTakenError(SharedMemoryError):
    """Shared memory that its creator cannot use any more, as another process keeps its lock, or broke or removed it."""


class SharedMemory:
    """A named piece of memory; a context manager. Made by ``create`` (the writer) or ``attach`` (a reader).

    ``size`` is in bytes, ``buffer`` a writable view of them all; take the lock to use it. Views and arrays of it stay
    valid after ``close``.
    """

    def __init__(self, segment: Segment | PosixSegment, name: str, owner: bool) -> None:
        self.name = name
        self.size: int = segment.size
        self.buffer = segment.view()
        self._segment = segment
        self._owner = owner
        self._locked = False
        self._closed = False

    @classmethod
    def create(cls, name: str, size: int, posix: bool | None = None) -> Self:
        """Make memory of ``size`` bytes, all zero, and what belongs to it; ``close`` removes it all.

        What a dead creator left under this name is removed first. ``posix`` selects the mode (by default the
        environment does). Raises SharedMemoryError, also if a living process holds memory of this name.
        """
        if not 0 < size < 2**32:
            raise SharedMemoryError(f"shared memory '{name}' cannot have {size} bytes")
        if _wants_posix() if posix is None else posix:
            return cls(PosixSegment.create(posix_memory.path_of(name), size), name, owner=True)
        return cls(Segment.create(sysv_memory.path_of(name), size), name, owner=True)

    @classmethod
    def attach(cls, name: str) -> Self:
        """Use the memory that another process made, in the mode in which it made it.

        A token file in /tmp means SysV; if there is none, an object of this name means POSIX. Raises
        SharedMemoryError if there is neither.
        """
        token = sysv_memory.path_of(name)
        if not token.exists() and (_wants_posix() or (posix_memory.FOLDER / name.removeprefix("/")).exists()):
            return cls(PosixSegment.attach(posix_memory.path_of(name)), name, owner=False)
        return cls(Segment.attach(token), name, owner=False)

    @contextmanager
    def lock(self, timeout: float = LOCK_PATIENCE) -> Iterator[None]:
        """Hold the mutex; raises SharedMemoryError when another holds it for ``timeout`` seconds.

        The creator's error is a MemoryTakenError, here and wherever the memory turns out to be broken.
        """
        deadline, is_taken = time.monotonic() + timeout, False
        while not is_taken:
            with self._used() as segment:
                is_taken = segment.lock(deadline - time.monotonic())
            if not is_taken and time.monotonic() >= deadline:
                raise self._error(f"was locked by another for {timeout:g} s")
        self._locked = True
        try:
            yield
        finally:
            self._locked = False
            with self._used() as segment:
                segment.unlock()

    def stamp(self, time_us: int) -> None:
        """Sets when the content was sampled (microseconds since the epoch); only while locked."""
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
        same content again. Raises SharedMemoryError as ``lock`` does.
        """
        with nullcontext() if self._locked else self.lock(), self._used() as segment:
            segment.wake()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for a notification without spinning: False when ``timeout`` seconds are over, or (SysV) a signal came.

        Raises SharedMemoryError when the creator has removed the memory.
        """
        with self._used() as segment:
            return segment.wait(timeout)

    def readers_waiting(self) -> int:
        with self._used() as segment:
            return segment.readers_waiting()

    @property
    def is_there(self) -> bool:
        """Whether it still exists: one that cannot be locked may only be held for long by another program."""
        with suppress(SharedMemoryError):
            return self.readers_waiting() >= 0
        return False

    def close(self) -> None:
        """Let go; the creator wakes all that wait and removes everything."""
        if self._closed:
            return
        self._closed = True
        self.buffer = memoryview(b"")
        if self._owner:
            self._segment.remove()
        os.close(self._segment.token)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _need_lock(self) -> None:
        if not self._locked:
            raise SharedMemoryError(f"shared memory '{self.name}' must be locked for its time stamp")

    @contextmanager
    def _used(self) -> Iterator[Segment | PosixSegment]:
        """The segment, whose OSErrors become sentences."""
        try:
            yield self._segment
        except OSError as error:
            reasons = {
                errno.ETIMEDOUT: "cannot notify any more: a reader was killed while it waited",
                errno.ENOTRECOVERABLE: "cannot be locked any more: its holder was killed",
            }
            remover = "another" if self._owner else "its creator"
            raise self._error(reasons.get(error.errno or 0, f"was removed by {remover}")) from None

    def _error(self, what: str) -> SharedMemoryError:
        kind = MemoryTakenError if self._owner else SharedMemoryError
        return kind(f"shared memory '{self.name}' {what}")


def _wants_posix() -> bool:
    return os.environ.get(MODE, "").startswith("1")
