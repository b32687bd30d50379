"""One shared memory in libcluon's SysV mode: a token file in /tmp, and segment, mutex and condition by its keys.

A key has 16 bits of the file's inode, 8 of the device and 8 of a project number (ftok of the C library), so two files
can give the same keys. A creator therefore takes another inode for its token when another file there has its keys.
Operations on semaphores end, though the wheels of sysv_ipc are built without time limits.
"""

import ctypes
import errno
import os
import stat
import weakref
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import sysv_ipc

FOLDER = "/tmp"
MAX_NAME = 254
MODE = 0o666
"""Whatever the umask: the application, another user, takes its lock, and looks for the token."""
ATTEMPTS = 100
MEMORY, MUTEX, CONDITION = 1, 2, 3  # libcluon's project numbers
_SEM_UNDO = 0x1000
_libc = ctypes.CDLL(None, use_errno=True)


class SharedMemoryError(OSError):
    """Shared memory that cannot be made, found or used; one sentence."""


class Time(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))

    @classmethod
    def of(cls, seconds: float) -> Self:
        return cls(*divmod(max(0, round(seconds * 1e9)), 1_000_000_000))


def path_of(name: str) -> Path:
    """The token file: ``foo`` and ``/foo`` are /tmp/foo, what begins with /tmp stays. Raises SharedMemoryError."""
    path = name if name.startswith(FOLDER) else f"{FOLDER}/{name.removeprefix('/')}"
    if not name.strip("/") or "\0" in name or len(path) > MAX_NAME:
        raise SharedMemoryError(f"'{name[:40]}' is not a name of shared memory, of at most {MAX_NAME} characters")
    return Path(path)


def token_key(status: os.stat_result, project: int) -> int:
    return status.st_ino & 0xFFFF | (status.st_dev & 0xFF) << 16 | project << 24


def twin_token(path: Path) -> Path | None:
    """Another file of the folder that has the keys of this one."""
    own = path.stat()
    with os.scandir(path.parent) as entries:
        # the inode of the listing is compared first: it costs no call
        near = [Path(e.path) for e in entries if (e.inode() ^ own.st_ino) & 0xFFFF == 0 and e.name != path.name]
    for other in near:
        with suppress(FileNotFoundError):
            status = other.lstat()
            if stat.S_ISREG(status.st_mode) and token_key(status, 1) == token_key(own, 1):
                return other
    return None


class _Operation(ctypes.Structure):
    _fields_ = (("number", ctypes.c_ushort), ("value", ctypes.c_short), ("flags", ctypes.c_short))


def operate_semaphore(id_: int, value: int, timeout: float | None, flags: int = 0) -> bool:
    """Add ``value`` to a semaphore (waiting while it would become negative), or wait for zero if ``value`` is 0.

    False when ``timeout`` seconds are over or a signal came. Raises OSError when the semaphore is gone.
    """
    operation, limit = _Operation(0, value, flags), None if timeout is None else ctypes.byref(Time.of(timeout))
    if _libc.semtimedop(id_, ctypes.byref(operation), 1, limit) == 0:
        return True
    code = ctypes.get_errno()
    if code not in (errno.EAGAIN, errno.EINTR):
        raise OSError(code, os.strerror(code))
    return False


@dataclass(frozen=True)
class Segment:
    """Handles of the objects; ``token`` is the descriptor of the token file at ``path``."""

    path: Path
    token: int
    memory: sysv_ipc.SharedMemory
    mutex: sysv_ipc.Semaphore
    condition: sysv_ipc.Semaphore

    @classmethod
    def create(cls, path: Path, size: int) -> Self:
        tried: list[int] = []
        try:
            for _ in range(ATTEMPTS):
                existed = path.exists()
                token = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, MODE)
                tried.append(token)
                with suppress(PermissionError):  # another user's
                    os.fchmod(token, MODE)
                status = os.fstat(token)
                with suppress(sysv_ipc.ExistentialError):  # another creator had the same key in the same moment
                    if twin_token(path) is None and _clear(status, existed):
                        objects = _made(status, size)
                        tried.remove(token)
                        return cls(path, token, *objects)
                path.unlink(missing_ok=True)  # it is still open, so that the next one has another inode
        except (OSError, ValueError, sysv_ipc.Error) as error:
            what = getattr(error, "strerror", None) or error
            raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {what} ({path})") from None
        finally:
            for each in tried:
                os.close(each)
        raise SharedMemoryError(f"{path}: no free key for shared memory in {ATTEMPTS} attempts")

    @classmethod
    def attach(cls, path: Path) -> Self:
        try:
            token = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise SharedMemoryError(f"shared memory '{path.name}' does not exist: {path}: {error.strerror}") from None
        memory, *others = (token_key(os.fstat(token), project) for project in (MEMORY, MUTEX, CONDITION))
        try:
            return cls(path, token, sysv_ipc.SharedMemory(memory), *map(sysv_ipc.Semaphore, others))
        except sysv_ipc.Error as error:
            os.close(token)
            raise SharedMemoryError(f"shared memory '{path.name}' has no content (yet): {error}") from None

    def view(self) -> memoryview:
        """A view of the data; the segment is detached when this view and all that came of it are gone."""
        array = (ctypes.c_ubyte * self.memory.size).from_address(self.memory.address)
        weakref.finalize(array, self.memory.detach).atexit = False
        return memoryview(array).cast("B")

    @property
    def size(self) -> int:
        return int(self.memory.size)

    def lock(self, timeout: float) -> bool:
        return operate_semaphore(self.mutex.id, -1, timeout, _SEM_UNDO)

    def unlock(self) -> None:
        operate_semaphore(self.mutex.id, 1, None, _SEM_UNDO)

    def wait(self, timeout: float | None) -> bool:
        return operate_semaphore(self.condition.id, 0, timeout)

    def wake(self) -> None:
        try:
            self.condition.value = 0
            self.condition.value = 1
        except sysv_ipc.Error as error:
            raise OSError(str(error)) from None

    def readers_waiting(self) -> int:
        try:
            return int(self.condition.waiting_for_zero)
        except sysv_ipc.Error as error:
            raise OSError(str(error)) from None

    def remove(self) -> None:
        """Wake all that wait and take everything away, the token file where it is still the same one.

        The mutex goes first: a woken reader cannot take it, and so does not read the last content once more.
        """
        with suppress(sysv_ipc.Error):
            self.mutex.remove()
        with suppress(OSError):
            self.wake()
        for part in (self.condition, self.memory):
            with suppress(sysv_ipc.Error):
                part.remove()
        remove_own(self.path, self.token)


def remove_own(path: Path, token: int) -> None:
    with suppress(FileNotFoundError):
        if os.path.samestat(path.stat(), os.fstat(token)):
            path.unlink()


def _made(status: os.stat_result, size: int) -> list[Any]:
    memory, *others = (token_key(status, project) for project in (MEMORY, MUTEX, CONDITION))
    made = [sysv_ipc.SharedMemory(memory, sysv_ipc.IPC_CREX, mode=MODE, size=size, init_character=b"\0")]
    try:
        made += [sysv_ipc.Semaphore(key, sysv_ipc.IPC_CREX, mode=MODE, initial_value=1) for key in others]
    except sysv_ipc.Error:
        made[0].remove()
        raise
    return made


def _clear(status: os.stat_result, existed: bool) -> bool:
    """Remove what a dead creator left; False if the keys belong to a memory of another name or another user."""
    with suppress(sysv_ipc.PermissionsError):
        with suppress(sysv_ipc.ExistentialError):
            memory = sysv_ipc.SharedMemory(token_key(status, MEMORY))
            users = memory.number_attached - 1
            memory.detach()
            if users and not existed:
                return False
            if users and Path(f"/proc/{memory.creator_pid}").exists():  # 0 in another namespace
                raise SharedMemoryError(f"process {memory.creator_pid} uses it")
            memory.remove()
        for project in (MUTEX, CONDITION):
            with suppress(sysv_ipc.ExistentialError):
                sysv_ipc.Semaphore(token_key(status, project)).remove()
        return True
    return False
