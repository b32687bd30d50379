"""The file in /tmp that names a SysV shared memory, and the keys that its inode gives.

A key has 16 bits of the inode, 8 of the device and 8 of a project number (ftok of the C library), so two files can
give the same keys. A creator therefore moves its token to another inode when another file there has its keys.
"""

import os
import stat
from contextlib import suppress
from pathlib import Path

FOLDER = "/tmp"
MAX_NAME = 254
MODE = 0o644
"""Whatever the umask: the application, another user, looks for it."""
ATTEMPTS = 100


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


def key(status: os.stat_result, project: int) -> int:
    """The SysV key of a file for a project number, as the C library's ftok makes it."""
    return status.st_ino & 0xFFFF | (status.st_dev & 0xFF) << 16 | project << 24


def open_existing(path: Path) -> int:
    """A descriptor of a token file that must exist; raises SharedMemoryError."""
    try:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise SharedMemoryError(f"shared memory '{path.name}' does not exist: {path}: {error.strerror}") from None


def open_or_create(path: Path) -> tuple[int, bool]:
    """A descriptor of the token file, and whether it was there before; raises SharedMemoryError."""
    existed = path.exists()
    try:
        token = os.open(path, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, MODE)
    except OSError as error:
        raise _not_made(path, error) from None
    if not existed:
        with suppress(PermissionError):  # another user made it meanwhile
            os.fchmod(token, MODE)
    return token, existed


def move_to_other_inode(path: Path) -> None:
    """Replace the token file by one whose keys no other file in its folder has; raises SharedMemoryError."""
    tried: list[Path] = []
    try:
        for attempt in range(ATTEMPTS):
            spare = path.with_name(f".{path.name}.{os.getpid()}.{attempt}")
            token = os.open(spare, os.O_RDONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, MODE)
            tried.append(spare)
            os.fchmod(token, MODE)
            os.close(token)
            if not collides(spare):
                spare.replace(path)
                return
    except OSError as error:
        raise _not_made(path, error) from None
    finally:
        for spare in tried:
            spare.unlink(missing_ok=True)
    raise SharedMemoryError(f"{path}: no free key for shared memory in {ATTEMPTS} attempts")


def collides(path: Path) -> bool:
    """Whether another file of the folder has the keys of this one."""
    return twin(path) is not None


def twin(path: Path) -> Path | None:
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
    return stat.S_ISREG(status.st_mode) and key(status, 1) == key(own, 1)


def _not_made(path: Path, error: OSError) -> SharedMemoryError:
    return SharedMemoryError(f"shared memory '{path.name}' cannot be made: {path}: {error.strerror}")
