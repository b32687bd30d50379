"""Mutex and condition of the C library inside of shared memory, as libcluon's POSIX mode uses them.

The mutex is robust (the death of its holder releases it) and, as the condition, shared between processes; the condition
counts on the monotonic clock. Reference: POSIX.1-2008, pthread_mutex_lock and pthread_cond_wait; the layouts are
those of glibc.
"""

import ctypes
import errno
import os
import platform
import re
import time

CLOCK_MONOTONIC = 1
_MUTEX_BYTES = 48 if platform.machine() == "aarch64" else 40
_CONDITION_BYTES = 48
MUTEX_AT = 8
CONDITION_AT = MUTEX_AT + _MUTEX_BYTES
HEADER_BYTES = CONDITION_AT + _CONDITION_BYTES
_SHARED, _ROBUST = 1, 1
_PATIENCE = 1.0

_libc = ctypes.CDLL(None)
_NEW_LAYOUT = tuple(map(int, re.findall(r"\d+", platform.libc_ver()[1])[:2])) >= (2, 41)
_REFERENCES_AT = 16  # in the condition: two counts of woken waiters
_WAITERS_AT = 28 if _NEW_LAYOUT else 36


class _Time(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class Header:
    """The first bytes of a shared memory: its size, the mutex, the condition; raises OSError where a call fails."""

    def __init__(self, memory: object) -> None:
        self._bytes = (ctypes.c_ubyte * HEADER_BYTES).from_buffer(memory)  # type: ignore[arg-type]
        address = ctypes.addressof(self._bytes)
        self._mutex, self._condition = ctypes.c_void_p(address + MUTEX_AT), ctypes.c_void_p(address + CONDITION_AT)
        self._size = ctypes.c_uint32.from_buffer(self._bytes)
        self._numbers = (ctypes.c_uint32 * (_CONDITION_BYTES // 4)).from_buffer(self._bytes, CONDITION_AT)

    @property
    def size(self) -> int:
        """Bytes of the data behind the header."""
        return self._size.value

    def make(self, size: int) -> None:
        """Set up a new memory."""
        attributes = ctypes.create_string_buffer(64)
        _call("pthread_mutexattr_init", attributes)
        _call("pthread_mutexattr_setpshared", attributes, _SHARED)
        _call("pthread_mutexattr_setrobust", attributes, _ROBUST)
        _call("pthread_mutex_init", self._mutex, attributes)
        _call("pthread_condattr_init", attributes)
        _call("pthread_condattr_setclock", attributes, CLOCK_MONOTONIC)
        _call("pthread_condattr_setpshared", attributes, _SHARED)
        _call("pthread_cond_init", self._condition, attributes)
        self._size.value = size

    def lock(self, timeout: float) -> bool:
        """Take the mutex; False when ``timeout`` seconds are over."""
        code = _libc.pthread_mutex_clocklock(self._mutex, CLOCK_MONOTONIC, ctypes.byref(_deadline(timeout)))
        return self._taken(code)

    def unlock(self) -> None:
        """Let go of the mutex."""
        _call("pthread_mutex_unlock", self._mutex)

    def wait(self, timeout: float) -> bool:
        """Wait for a notification with the mutex held; False when ``timeout`` seconds are over."""
        until = ctypes.byref(_deadline(timeout))
        return self._taken(_libc.pthread_cond_timedwait(self._condition, self._mutex, until))

    def notify_all(self) -> None:
        """Wake all that wait; raises TimeoutError where that would block as a waiter was killed.

        Before 2.41, glibc counts those that were woken before and waits for them to leave; a killed one never does.
        """
        patience = time.monotonic() + _PATIENCE
        while self._leaving():
            if time.monotonic() > patience:
                raise TimeoutError(errno.ETIMEDOUT, "a waiter was killed")
            time.sleep(0.0005)
        _call("pthread_cond_broadcast", self._condition)

    def waiters(self) -> int:
        """How many wait at this moment."""
        return int(self._numbers[_WAITERS_AT // 4]) >> 3  # glibc counts by eights

    def _leaving(self) -> int:
        """How many that were woken before have not left yet (glibc's __g_refs by the lowest bit of __wseq)."""
        if _NEW_LAYOUT:
            return 0
        first = self._numbers[0] & 1 ^ 1
        return int(self._numbers[_REFERENCES_AT // 4 + first]) >> 1

    def _taken(self, code: int) -> bool:
        if code == errno.EOWNERDEAD:
            _call("pthread_mutex_consistent", self._mutex)
            return True
        if code not in (0, errno.ETIMEDOUT):
            raise OSError(code, os.strerror(code))
        return code == 0


def _call(name: str, *arguments: object) -> None:
    code = getattr(_libc, name)(*arguments)
    if code:
        raise OSError(code, f"{name}: {os.strerror(code)}")


def _deadline(seconds: float) -> _Time:
    at = time.monotonic_ns() + round(max(0.0, seconds) * 1e9)
    return _Time(*divmod(at, 1_000_000_000))
