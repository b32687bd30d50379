"""The SysV objects of one shared memory, found by the keys of its token file: segment, mutex and condition."""

import ctypes
import os
import weakref
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import sysv_ipc

from dodo_dsl.opendlv.memory import token_file
from dodo_dsl.opendlv.memory.semaphore import Result, operate
from dodo_dsl.opendlv.memory.token_file import SharedMemoryError

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
        for _ in range(token_file.ATTEMPTS):
            token, existed = token_file.open_or_create(path)
            try:
                status = os.fstat(token)
                if not token_file.collides(path) and _clear(path, status, existed):
                    return cls(path, token, *_made(status, size))
            except sysv_ipc.ExistentialError:
                pass  # another creator had the same key in the same moment
            except (OSError, ValueError, sysv_ipc.Error) as error:
                os.close(token)
                raise SharedMemoryError(f"shared memory '{path.name}' cannot be made: {error}") from None
            os.close(token)
            token_file.move_to_other_inode(path)
        raise SharedMemoryError(f"{path}: no free key for shared memory")

    @classmethod
    def attach(cls, path: Path) -> Self:
        """Find what another process made; raises SharedMemoryError."""
        token = token_file.open_existing(path)
        status = os.fstat(token)
        try:
            _refuse_twin(path)
            return cls(
                path,
                token,
                sysv_ipc.SharedMemory(token_file.key(status, MEMORY)),
                sysv_ipc.Semaphore(token_file.key(status, MUTEX)),
                sysv_ipc.Semaphore(token_file.key(status, CONDITION)),
            )
        except sysv_ipc.Error as error:
            os.close(token)
            raise SharedMemoryError(f"shared memory '{path.name}' has no content (yet): {error}") from None
        except SharedMemoryError:
            os.close(token)
            raise

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
        return operate(self.mutex.id, -1, timeout, undo=True)

    def unlock(self) -> None:
        operate(self.mutex.id, 1, None, undo=True)

    def wait(self, timeout: float | None) -> Result:
        """Wait for a notification; raises OSError when the creator has removed the memory."""
        return operate(self.condition.id, 0, timeout)

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

        The mutex goes first: who wakes cannot take it, and so does not read the last content once more.
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
        token_file.key(status, MEMORY), sysv_ipc.IPC_CREX, mode=MODE, size=size, init_character=b"\0"
    )
    made = [memory]
    try:
        for project in (MUTEX, CONDITION):
            key = token_file.key(status, project)
            made.append(sysv_ipc.Semaphore(key, sysv_ipc.IPC_CREX, mode=MODE, initial_value=1))
    except sysv_ipc.Error:
        for part in made:
            part.remove()
        raise
    return made[0], made[1], made[2]


def _clear(path: Path, status: os.stat_result, existed: bool) -> bool:
    """Remove what a dead creator left; False where the keys belong to a memory of another name or another user."""
    try:
        return _remove_leftover(path, status, existed)
    except sysv_ipc.PermissionsError:
        return False


def _remove_leftover(path: Path, status: os.stat_result, existed: bool) -> bool:
    """As above; raises sysv_ipc.PermissionsError for what belongs to another user."""
    with suppress(sysv_ipc.ExistentialError):
        memory = sysv_ipc.SharedMemory(token_file.key(status, MEMORY))
        users = memory.number_attached - 1
        memory.detach()
        if users and not existed:
            return False
        if users and _alive(memory.creator_pid):
            raise SharedMemoryError(f"process {memory.creator_pid} uses it ({path})")
        memory.remove()
    for project in (MUTEX, CONDITION):
        with suppress(sysv_ipc.ExistentialError):
            sysv_ipc.Semaphore(token_file.key(status, project)).remove()
    return True


def _refuse_twin(path: Path) -> None:
    """Refuses two token files with the same keys, which name one memory."""
    with suppress(FileNotFoundError):
        twin = token_file.twin(path)
        if twin is not None and twin.stat().st_size == 0:
            raise SharedMemoryError(
                f"shared memory '{path.name}' cannot be told from '{twin.name}': the keys of {path} and {twin} collide "
                f"(ftok); remove the unused one, or restart its creator"
            )


def _alive(pid: int) -> bool:
    """Whether a process of this PID namespace lives; the creator's is 0 when it is in another one."""
    if pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
