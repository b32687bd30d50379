"""One shared memory in libcluon's POSIX mode: an object of shm_open whose first bytes hold size, mutex, condition.

The time stamp of the content is the object's own time of modification. Nothing lies in /tmp. Mutex and condition are
those of the C library: the mutex is robust (the death of its holder releases it) and, as the condition, shared between
processes; the condition counts on the monotonic clock. Reference: POSIX.1-2008, pthread_mutex_lock and
pthread_cond_wait; the layouts are those of glibc.
"""

import ctypes
import errno
import fcntl
import math
import mmap
import os
import platform
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Self

from dodo_dsl.opendlv.sysv_memory import MAX_NAME, MODE, SharedMemoryError, Time, remove_own

CLOCK_MONOTONIC = 1
_MUTEX_BYTES = 48 if platform.machine() == "aarch64" else 40
_CONDITION_BYTES = 48
MUTEX_AT = 8
CONDITION_AT = MUTEX_AT + _MUTEX_BYTES
HEADER_BYTES = CONDITION_AT + _CONDITION_BYTES
_PATIENCE = 1.0
_SLICE = 0.1
"""Seconds."""

_libc = ctypes.CDLL(None)
_NEW_LAYOUT = tuple(map(int, re.findall(r"\d+", platform.libc_ver()[1])[:2])) >= (2, 41)
_REFERENCES_AT = 16  # in the condition: two counts of woken waiters
_WAITERS_AT = 28 if _NEW_LAYOUT else 36

FOLDER = Path("/dev/shm")  # where the C library's shm_open keeps its objects
_FLAGS = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC


def path_of(name: str) -> Path:
    """The object's file: ``foo`` and ``/foo`` are the same; raises SharedMemoryError."""
    short = name.removeprefix("/")
    if not short or "/" in short or "\0" in short or short in (".", "..") or len(short) >= MAX_NAME:
        raise SharedMemoryError(f"'{name[:40]}' is not a name of POSIX shared memory")
    return FOLDER / short


class PosixSegment:
    """The object at ``path``, whose descriptor is ``token``: its size, the mutex and the condition, then the data."""

    def __init__(self, path: Path, token: int, memory: mmap.mmap) -> None:
        self.path, self.token = path, token
        self._memory = memory
        self._bytes = (ctypes.c_ubyte * HEADER_BYTES).from_buffer(memory)
        address = ctypes.addressof(self._bytes)
        self._mutex, self._condition = ctypes.c_void_p(address + MUTEX_AT), ctypes.c_void_p(address + CONDITION_AT)
        self._size = ctypes.c_uint32.from_buffer(self._bytes)
        self._numbers = (ctypes.c_uint32 * (_CONDITION_BYTES // 4)).from_buffer(self._bytes, CONDITION_AT)

    @classmethod
    def create(cls, path: Path, size: int) -> Self:
        token = -1
        try:
            _remove_orphan(path)
            token = os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, MODE)
            os.fchmod(token, MODE)
            fcntl.flock(token, fcntl.LOCK_SH | fcntl.LOCK_NB)  # shows other creators that we live
            os.posix_fallocate(token, 0, HEADER_BYTES + size)  # a full memory is an error now, not a SIGBUS later
            made = cls(path, token, mmap.mmap(token, HEADER_BYTES + size))
            made._set_up(size)
        except OSError as error:
            if token >= 0:
                path.unlink(missing_ok=True)
                os.close(token)
            what = f"{path}: {error.strerror or error}"
            raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {what}") from None
        return made

    @classmethod
    def attach(cls, path: Path) -> Self:
        try:
            token = os.open(path, _FLAGS)
        except OSError as error:
            raise SharedMemoryError(f"shared memory '{path.name}' does not exist: {path}: {error.strerror}") from None
        whole = os.fstat(token).st_size
        if whole > HEADER_BYTES:
            found = cls(path, token, mmap.mmap(token, whole))
            if 0 < found.size <= whole - HEADER_BYTES:
                return found
        os.close(token)
        raise SharedMemoryError(f"shared memory '{path.name}' has no content (yet): {path} has {whole} bytes")

    def _set_up(self, size: int) -> None:
        attributes = ctypes.create_string_buffer(64)
        _call("pthread_mutexattr_init", attributes)
        _call("pthread_mutexattr_setpshared", attributes, 1)
        _call("pthread_mutexattr_setrobust", attributes, 1)
        _call("pthread_mutex_init", self._mutex, attributes)
        _call("pthread_condattr_init", attributes)
        _call("pthread_condattr_setclock", attributes, CLOCK_MONOTONIC)
        _call("pthread_condattr_setpshared", attributes, 1)
        _call("pthread_cond_init", self._condition, attributes)
        self._size.value = size

    @property
    def size(self) -> int:
        return self._size.value

    def view(self) -> memoryview:
        return memoryview(self._memory)[HEADER_BYTES : HEADER_BYTES + self.size]

    def lock(self, timeout: float) -> bool:
        return self._taken(_libc.pthread_mutex_clocklock(self._mutex, CLOCK_MONOTONIC, _deadline(timeout)))

    def unlock(self) -> None:
        _call("pthread_mutex_unlock", self._mutex)

    def wait(self, timeout: float | None) -> bool:
        """Wait for a notification; raises OSError when the creator has removed the memory.

        Python looks for signals, and whether the memory is still there, ten times a second.
        """
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            is_woken = self.lock(min(_SLICE, end - time.monotonic()))
            if is_woken:
                try:
                    until = _deadline(min(_SLICE, end - time.monotonic()))
                    is_woken = self._taken(_libc.pthread_cond_timedwait(self._condition, self._mutex, until))
                finally:
                    self.unlock()
            if os.fstat(self.token).st_nlink == 0:
                raise FileNotFoundError
            if is_woken or time.monotonic() >= end:
                return is_woken

    def wake(self) -> None:
        """Wake all that wait; raises TimeoutError if that would block as a waiter was killed.

        Before 2.41, glibc counts those that were woken before and waits for them to leave; a killed one never does.
        """
        patience = time.monotonic() + _PATIENCE
        while self._leaving():
            if time.monotonic() > patience:
                raise TimeoutError(errno.ETIMEDOUT, "a waiter was killed")
            time.sleep(0.0005)
        _call("pthread_cond_broadcast", self._condition)

    def readers_waiting(self) -> int:
        return int(self._numbers[_WAITERS_AT // 4]) >> 3  # glibc counts by eights

    def remove(self) -> None:
        remove_own(self.path, self.token)
        with suppress(TimeoutError):
            self.wake()

    def _leaving(self) -> int:
        """How many that were woken before have not left yet (glibc's __g_refs by the lowest bit of __wseq)."""
        first = self._numbers[0] & 1 ^ 1
        return 0 if _NEW_LAYOUT else int(self._numbers[_REFERENCES_AT // 4 + first]) >> 1

    def _taken(self, code: int) -> bool:
        """Of a call that takes the mutex, which its dead holder may have left."""
        if code == errno.EOWNERDEAD:
            _call("pthread_mutex_consistent", self._mutex)
        elif code not in (0, errno.ETIMEDOUT):
            raise OSError(code, os.strerror(code))
        return code != errno.ETIMEDOUT


def _call(name: str, *arguments: object) -> None:
    if code := getattr(_libc, name)(*arguments):
        raise OSError(code, f"{name}: {os.strerror(code)}")


def _deadline(seconds: float) -> object:
    return ctypes.byref(Time.of(time.monotonic() + max(0.0, seconds)))


def _remove_orphan(path: Path) -> None:
    """Remove an object that no living creator of ours holds; libcluon's creators cannot be seen, and are replaced."""
    with suppress(FileNotFoundError):
        token = os.open(path, _FLAGS)
        try:
            fcntl.flock(token, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()
        except BlockingIOError:
            raise OSError("a living process uses it") from None
        finally:
            os.close(token)
