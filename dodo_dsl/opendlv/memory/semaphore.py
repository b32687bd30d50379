"""Operations on SysV semaphores that end: the wheels of sysv_ipc are built without time limits."""

import ctypes
import errno
import os
from enum import Enum, auto

_SEM_UNDO = 0x1000
_libc = ctypes.CDLL(None, use_errno=True)


class _Operation(ctypes.Structure):
    _fields_ = (("number", ctypes.c_ushort), ("value", ctypes.c_short), ("flags", ctypes.c_short))


class _Time(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class Result(Enum):
    """How an operation ended."""

    DONE = auto()
    TIMEOUT = auto()
    SIGNAL = auto()


def operate(id_: int, value: int, timeout: float | None, undo: bool = False) -> Result:
    """Add ``value`` to a semaphore (waiting while it would become negative), or wait for zero where ``value`` is 0.

    ``undo`` lets the kernel take the change back when this process dies. Raises OSError when the semaphore is gone.
    """
    operation = _Operation(0, value, _SEM_UNDO if undo else 0)
    limit = None
    if timeout is not None:
        seconds, nanoseconds = divmod(max(0, round(timeout * 1e9)), 1_000_000_000)
        limit = ctypes.byref(_Time(seconds, nanoseconds))
    if _libc.semtimedop(id_, ctypes.byref(operation), 1, limit) == 0:
        return Result.DONE
    code = ctypes.get_errno()
    if code == errno.EAGAIN:
        return Result.TIMEOUT
    if code == errno.EINTR:
        return Result.SIGNAL
    raise OSError(code, os.strerror(code))
