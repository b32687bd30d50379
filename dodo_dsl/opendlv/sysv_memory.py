"""One shared memory in libcluon's SysV mode: a token file in /tmp, and segment, mutex and condition by its keys.

A key has 16 bits of the file's inode, 8 of the device and 8 of a project number (ftok of the C library), so two files
can give the same keys. A creator therefore moves its token to another inode when another file there has its keys.
Operations on semaphores end, though the wheels of sysv_ipc are built without time limits.
"""

import ctypes
import errno
import os
import stat
import weakref
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import Self

import sysv_ipc

FOLDER = "/tmp"
MAX_NAME = 254
TOKEN_MODE = 0o644
"""Whatever the umask: the application, another user, looks for it."""
TOKEN_ATTEMPTS = 100


class SharedMemoryError(OSError):
    """Shared memory that cannot be made, found or used; one sentence."""


class MemoryTakenError(SharedMemoryError):
    """Shared memory that its creator cannot use any more, as another process keeps its lock, or broke or removed it."""


def path_of(name: str) -> Path:
    """The token file: ``foo`` and ``/foo`` are /tmp/foo, what begins with /tmp stays. Raises SharedMemoryError."""
    if not name.strip("/") or "\0" in name:
        raise SharedMemoryError(f"'{name}' is not a name of shared memory")
    path = name if name.startswith(FOLDER) else f"{FOLDER}/{name.removeprefix('/')}"
    if len(path) > MAX_NAME:
        raise SharedMemoryError(f"the name of shared memory '{name[:40]}...' is longer than {MAX_NAME} characters")
    return Path(path)


def token_key(status: os.stat_result, project: int) -> int:
    """The SysV key of a file for a project number, as the C library's ftok makes it."""
    return status.st_ino & 0xFFFF | (status.st_dev & 0xFF) << 16 | project << 24


def open_token(path: Path) -> int:
    """A descriptor of a token file that must exist; raises SharedMemoryError."""
    try:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise SharedMemoryError(f"shared memory '{path.name}' does not exist: {path}: {error.strerror}") from None


def open_or_create_token(path: Path) -> tuple[int, bool]:
    """A descriptor of the token file, and whether it was there before; raises SharedMemoryError."""
    existed = path.exists()
    try:
        token = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, TOKEN_MODE)
    except OSError as error:
        raise _not_made(path, error) from None
    if not existed:
        with suppress(PermissionError):  # another user made it meanwhile
            os.fchmod(token, TOKEN_MODE)
    return token, existed


def move_to_other_inode(path: Path) -> None:
    """Replace the token file by one whose keys no other file in its folder has; raises SharedMemoryError."""
    tried: list[Path] = []
    try:
        for attempt in range(TOKEN_ATTEMPTS):
            spare = path.with_name(f".{path.name}.{os.getpid()}.{attempt}")
            token = os.open(spare, os.O_RDONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, TOKEN_MODE)
            tried.append(spare)
            os.fchmod(token, TOKEN_MODE)
            os.close(token)
            if twin_token(spare) is None:
                spare.replace(path)
                return
    except OSError as error:
        raise _not_made(path, error) from None
    finally:
        for spare in tried:
            spare.unlink(missing_ok=True)
    raise SharedMemoryError(f"{path}: no free key for shared memory in {TOKEN_ATTEMPTS} attempts")


def twin_token(path: Path) -> Path | None:
    """Another file of the folder that has the keys of this one."""
    own = path.stat()
    with os.scandir(path.parent) as entries:
        # the inode of the listing is compared first: it costs no call
        near = [entry for entry in entries if (entry.inode() ^ own.st_ino) & 0xFFFF == 0]
        return next((Path(e.path) for e in near if e.name != path.name and _same_key(e, own)), None)


def _same_key(entry: "os.DirEntry[str]", own: os.stat_result) -> bool:
    try:
        status = entry.stat(follow_symlinks=False)
    except FileNotFoundError:
        return False
    return stat.S_ISREG(status.st_mode) and token_key(status, 1) == token_key(own, 1)


def _not_made(path: Path, error: OSError) -> SharedMemoryError:
    return SharedMemoryError(f"shared memory '{path.name}' cannot be made: {path}: {error.strerror}")


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


_ENDED = {errno.EAGAIN: Result.TIMEOUT, errno.EINTR: Result.SIGNAL}


def operate_semaphore(id_: int, value: int, timeout: float | None, undo: bool = False) -> Result:
    """Add ``value`` to a semaphore (waiting while it would become negative), or wait for zero if ``value`` is 0.

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
    if code in _ENDED:
        return _ENDED[code]
    raise OSError(code, os.strerror(code))


MEMORY, MUTEX, CONDITION = 1, 2, 3  # libcluon's project numbers
MODE = 0o666


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
        """Make all of it anew; raises SharedMemoryError."""
        for _ in range(TOKEN_ATTEMPTS):
            token, existed = open_or_create_token(path)
            try:
                status = os.fstat(token)
                if twin_token(path) is None and _clear(path, status, existed):
                    return cls(path, token, *_made(status, size))
            except sysv_ipc.ExistentialError:
                pass  # another creator had the same key in the same moment
            except (OSError, ValueError, sysv_ipc.Error) as error:
                os.close(token)
                raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {error}") from None
            os.close(token)
            move_to_other_inode(path)
        raise SharedMemoryError(f"{path}: no free key for shared memory")

    @classmethod
    def attach(cls, path: Path) -> Self:
        """Find what another process made; raises SharedMemoryError."""
        token = open_token(path)
        status = os.fstat(token)
        try:
            _refuse_twin(path)
            return cls(
                path,
                token,
                sysv_ipc.SharedMemory(token_key(status, MEMORY)),
                sysv_ipc.Semaphore(token_key(status, MUTEX)),
                sysv_ipc.Semaphore(token_key(status, CONDITION)),
            )
        except (sysv_ipc.Error, SharedMemoryError) as error:
            os.close(token)
            if isinstance(error, SharedMemoryError):
                raise
            raise SharedMemoryError(f"shared memory '{path.name}' has no content (yet): {error}") from None

    def view(self) -> memoryview:
        """A view of the data; the segment is detached when this view and all that came of it are gone."""
        array = (ctypes.c_ubyte * self.memory.size).from_address(self.memory.address)
        weakref.finalize(array, self.memory.detach).atexit = False
        return memoryview(array).cast("B")

    @property
    def size(self) -> int:
        """Bytes of the data."""
        return int(self.memory.size)

    def lock(self, timeout: float) -> Result:
        """Take the mutex; TIMEOUT when another holds it for ``timeout`` seconds. Raises OSError when it is gone."""
        return operate_semaphore(self.mutex.id, -1, timeout, undo=True)

    def unlock(self) -> None:
        operate_semaphore(self.mutex.id, 1, None, undo=True)

    def wait(self, timeout: float | None) -> Result:
        """Wait for a notification; raises OSError when the creator has removed the memory."""
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

    def close(self) -> None:
        """Forget the token file; the segment itself lives as long as its view."""
        os.close(self.token)

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
        with suppress(FileNotFoundError):
            if os.path.samestat(self.path.stat(), os.fstat(self.token)):
                self.path.unlink()


def _made(status: os.stat_result, size: int) -> tuple[sysv_ipc.SharedMemory, sysv_ipc.Semaphore, sysv_ipc.Semaphore]:
    memory = sysv_ipc.SharedMemory(
        token_key(status, MEMORY), sysv_ipc.IPC_CREX, mode=MODE, size=size, init_character=b"\0"
    )
    made = [memory]
    try:
        for project in (MUTEX, CONDITION):
            key = token_key(status, project)
            made.append(sysv_ipc.Semaphore(key, sysv_ipc.IPC_CREX, mode=MODE, initial_value=1))
    except sysv_ipc.Error:
        for part in made:
            part.remove()
        raise
    return made[0], made[1], made[2]


def _clear(path: Path, status: os.stat_result, existed: bool) -> bool:
    """Remove what a dead creator left; False if the keys belong to a memory of another name or another user."""
    with suppress(sysv_ipc.PermissionsError):
        with suppress(sysv_ipc.ExistentialError):
            memory = sysv_ipc.SharedMemory(token_key(status, MEMORY))
            users = memory.number_attached - 1
            memory.detach()
            if users and not existed:
                return False
            if users and _alive(memory.creator_pid):
                raise SharedMemoryError(f"process {memory.creator_pid} uses it ({path})")
            memory.remove()
        for project in (MUTEX, CONDITION):
            with suppress(sysv_ipc.ExistentialError):
                sysv_ipc.Semaphore(token_key(status, project)).remove()
        return True
    return False


def _refuse_twin(path: Path) -> None:
    """Refuses two token files with the same keys, which name one memory."""
    with suppress(FileNotFoundError):
        twin = twin_token(path)
        if twin is not None and twin.stat().st_size == 0:
            raise SharedMemoryError(
                f"shared memory '{path.name}' cannot be distinguished from '{twin.name}': "
                f"the keys of {path} and {twin} collide (ftok); remove the unused one, or restart its creator"
            )


def _alive(pid: int) -> bool:
    """Whether a process of this PID namespace lives; the creator's is 0 when it is in another one."""
    if pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except OSError as error:
        return error.errno != errno.ESRCH
    return True
