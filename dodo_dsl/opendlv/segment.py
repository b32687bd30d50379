"""The SysV objects of one shared memory, found by the keys of its token file: segment, mutex and condition."""

import ctypes
import os
import weakref
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import sysv_ipc

from dodo_dsl.opendlv import tokenfile
from dodo_dsl.opendlv.tokenfile import SharedMemoryError

MEMORY, MUTEX, CONDITION = 1, 2, 3  # libcluon's project numbers
MODE = 0o666


@dataclass(frozen=True)
class Segment:
    """Handles of the objects; `token` is the descriptor of the token file at `path`."""

    path: Path
    token: int
    memory: sysv_ipc.SharedMemory
    mutex: sysv_ipc.Semaphore
    condition: sysv_ipc.Semaphore

    @classmethod
    def create(cls, path: Path, size: int) -> Self:
        """Make all of it anew; raises SharedMemoryError."""
        for _ in range(tokenfile.ATTEMPTS):
            token, existed = tokenfile.open_or_create(path)
            try:
                status = os.fstat(token)
                if not tokenfile.collides(path) and _clear(path, status, existed):
                    return cls(path, token, *_made(status, size))
            except sysv_ipc.ExistentialError:
                pass  # another creator had the same key in the same moment
            except (OSError, ValueError, sysv_ipc.Error) as error:
                os.close(token)
                raise SharedMemoryError(f"shared memory `{path.name}` cannot be made: {error}") from None
            os.close(token)
            tokenfile.move_to_other_inode(path)
        raise SharedMemoryError(f"{path}: no free key for shared memory")

    @classmethod
    def attach(cls, path: Path) -> Self:
        """Find what another process made; raises SharedMemoryError."""
        token = tokenfile.open_existing(path)
        status = os.fstat(token)
        try:
            return cls(
                path,
                token,
                sysv_ipc.SharedMemory(tokenfile.key(status, MEMORY)),
                sysv_ipc.Semaphore(tokenfile.key(status, MUTEX)),
                sysv_ipc.Semaphore(tokenfile.key(status, CONDITION)),
            )
        except sysv_ipc.Error as error:
            os.close(token)
            raise SharedMemoryError(f"shared memory `{path.name}` has no content (yet): {error}") from None

    def view(self) -> memoryview:
        """A view of the data; the segment is detached when this view and all that came of it are gone."""
        array = (ctypes.c_ubyte * self.memory.size).from_address(self.memory.address)
        weakref.finalize(array, self.memory.detach).atexit = False
        return memoryview(array).cast("B")

    def close(self) -> None:
        """Forget the token file; the segment itself lives as long as its view."""
        os.close(self.token)

    def remove(self) -> None:
        """Take everything away, the token file where it is still the same one."""
        for part in (self.condition, self.mutex, self.memory):
            with suppress(sysv_ipc.Error):
                part.remove()
        with suppress(FileNotFoundError):
            if os.path.samestat(self.path.stat(), os.fstat(self.token)):
                self.path.unlink()


def _made(status: os.stat_result, size: int) -> tuple[sysv_ipc.SharedMemory, sysv_ipc.Semaphore, sysv_ipc.Semaphore]:
    memory = sysv_ipc.SharedMemory(
        tokenfile.key(status, MEMORY), sysv_ipc.IPC_CREX, mode=MODE, size=size, init_character=b"\0"
    )
    made = [memory]
    try:
        for project in (MUTEX, CONDITION):
            key = tokenfile.key(status, project)
            made.append(sysv_ipc.Semaphore(key, sysv_ipc.IPC_CREX, mode=MODE, initial_value=1))
    except sysv_ipc.Error:
        for part in made:
            part.remove()
        raise
    return made[0], made[1], made[2]


def _clear(path: Path, status: os.stat_result, existed: bool) -> bool:
    """Remove what a dead creator left; False where the keys belong to a memory under another name."""
    with suppress(sysv_ipc.ExistentialError):
        memory = sysv_ipc.SharedMemory(tokenfile.key(status, MEMORY))
        users = memory.number_attached - 1
        memory.detach()
        if users and not existed:
            return False
        if users and _alive(memory.creator_pid):
            raise SharedMemoryError(f"process {memory.creator_pid} uses it ({path})")
        memory.remove()
    for project in (MUTEX, CONDITION):
        with suppress(sysv_ipc.ExistentialError):
            sysv_ipc.Semaphore(tokenfile.key(status, project)).remove()
    return True


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
