"""One shared memory in libcluon's POSIX mode: an object of shm_open whose first bytes hold size, mutex, condition.

The time stamp of the content is the object's own time of modification. Nothing lies in /tmp.
"""

import fcntl
import math
import mmap
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Self

from dodo_dsl.opendlv.memory.pthreads import HEADER_BYTES, Header
from dodo_dsl.opendlv.memory.semaphore import Result
from dodo_dsl.opendlv.memory.token_file import MAX_NAME, SharedMemoryError

FOLDER = Path("/dev/shm")  # where the C library's shm_open keeps its objects
_SLICE = 0.1  # seconds
MODE = 0o666
"""Whatever the umask: the application, another user, takes its lock."""
_FLAGS = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC


def path_of(name: str) -> Path:
    """The object's file: ``foo`` and ``/foo`` are the same; raises SharedMemoryError."""
    short = name.removeprefix("/")
    if not short or "/" in short or "\0" in short or short in (".", ".."):
        raise SharedMemoryError(f"'{name}' is not a name of POSIX shared memory")
    if len(short) >= MAX_NAME:
        raise SharedMemoryError(f"the name of shared memory '{name[:40]}...' is longer than {MAX_NAME} characters")
    return FOLDER / short


class PosixSegment:
    """The object at ``path``; ``token`` is its descriptor."""

    def __init__(self, path: Path, token: int, memory: mmap.mmap, header: Header) -> None:
        self.path, self.token, self.size = path, token, header.size
        self._memory, self._header = memory, header

    @classmethod
    def create(cls, path: Path, size: int) -> Self:
        """Make it anew; what a dead creator left is removed. Raises SharedMemoryError."""
        try:
            _remove_orphan(path)
            token = os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, MODE)
        except SharedMemoryError:
            raise
        except OSError as error:
            raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {path}: {error.strerror}") from None
        try:
            os.fchmod(token, MODE)
            fcntl.flock(token, fcntl.LOCK_SH | fcntl.LOCK_NB)  # tells other creators that we live
            os.posix_fallocate(token, 0, HEADER_BYTES + size)  # a full memory is an error now, not a SIGBUS later
            memory = mmap.mmap(token, HEADER_BYTES + size)
            header = Header(memory)
            header.make(size)
        except OSError as error:
            path.unlink(missing_ok=True)
            os.close(token)
            raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {error.strerror}") from None
        return cls(path, token, memory, header)

    @classmethod
    def attach(cls, path: Path) -> Self:
        """Find what another process made; raises SharedMemoryError."""
        try:
            token = os.open(path, _FLAGS)
        except OSError as error:
            raise SharedMemoryError(f"shared memory '{path.name}' does not exist: {path}: {error.strerror}") from None
        whole = os.fstat(token).st_size
        if whole > HEADER_BYTES:
            memory = mmap.mmap(token, whole)
            header = Header(memory)
            if 0 < header.size <= whole - HEADER_BYTES:
                return cls(path, token, memory, header)
        os.close(token)
        raise SharedMemoryError(f"shared memory '{path.name}' has no content (yet): {path} has {whole} bytes")

    def view(self) -> memoryview:
        """A view of the data, which keeps the memory mapped."""
        return memoryview(self._memory)[HEADER_BYTES : HEADER_BYTES + self.size]

    def lock(self, timeout: float) -> Result:
        """Take the mutex; TIMEOUT when another holds it for ``timeout`` seconds. Raises OSError where it is broken."""
        return Result.DONE if self._header.lock(timeout) else Result.TIMEOUT

    def unlock(self) -> None:
        self._header.unlock()

    def wait(self, timeout: float | None) -> Result:
        """Wait for a notification; raises OSError when the creator has removed the memory.

        Python looks for signals, and whether the memory is still there, ten times a second.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            left = min(_SLICE, end - time.monotonic())
            done = self._header.lock(left) and self._waited(min(_SLICE, end - time.monotonic()))
            if os.fstat(self.token).st_nlink == 0:
                raise FileNotFoundError
            if done or time.monotonic() >= end:
                return Result.DONE if done else Result.TIMEOUT

    def _waited(self, timeout: float) -> bool:
        try:
            return self._header.wait(timeout)
        finally:
            self._header.unlock()

    def wake(self) -> None:
        """Wake all that wait; raises TimeoutError where one of them was killed."""
        self._header.notify_all()

    def readers_waiting(self) -> int:
        return self._header.waiters()

    def close(self) -> None:
        """Forget the object; its memory lives as long as the views of it."""
        os.close(self.token)

    def remove(self) -> None:
        """Take the object away where it is still the same one, and wake all that wait."""
        with suppress(FileNotFoundError):
            if os.path.samestat(self.path.stat(), os.fstat(self.token)):
                self.path.unlink()
        with suppress(TimeoutError):
            self.wake()


def _remove_orphan(path: Path) -> None:
    """Remove an object that no living creator of ours holds; libcluon's creators cannot be seen, and are replaced."""
    with suppress(FileNotFoundError):
        token = os.open(path, _FLAGS)
        try:
            fcntl.flock(token, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()
        except BlockingIOError:
            raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: a living process uses it") from None
        finally:
            os.close(token)
