"""What a sandbox prepares once for the application: its folders, and under root a user id that nobody else has.

Folders are ``/tmp``, a home, the application's own with writes apart, and what it reads. The user's umask decides about
none of them: the application's user must enter them.

The kernel counts processes, inotify instances and bytes of message queues by user, on the whole machine: in all
containers and namespaces, whose processes this one may not see. So an id is taken as long as a process has it.
"""

import contextlib
import errno
import os
import resource
import signal
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.run.process import namespaces

_SIZE = "size=1g,mode=0755"
_MODE = 0o755
_SYSTEM = Path("/usr")
"""What packages of the system install: everybody can read it."""
_READABLE = stat.S_IROTH | stat.S_IXOTH


class Places:
    """Folders that belong to ``user``, None for that of this process. To be made by a sandbox with own mounts."""

    def __init__(self, user: int | None) -> None:
        self.user = user
        """The user that the application runs as; None for the user of this process."""
        self._root = Path(tempfile.mkdtemp(prefix="dodo-application-", dir=namespaces.SHARED[0]))  # the sandbox's own
        namespaces.mount_tmpfs(self._root, _SIZE)
        self.home = self._own("home")
        self.shared = {str(place): self._shallow(place) for place in namespaces.SHARED if place.is_dir()}
        """``/tmp`` and ``/dev/shm`` by their names, without the host's folders that are mounted there."""
        self.mounted = tuple(str(path) for place in self.shared for path in Path(place).iterdir() if path.is_mount())
        """What is mounted there, and must be a mount to the application as well: no other folder can be removed."""
        self._shown: dict[str, tuple[Path, bool]] = {}
        self._read: dict[str, Path] = {}

    def _shallow(self, place: Path) -> Path:
        target = self._folder(place.name)
        namespaces.bind(place, target, deep=False)
        return target

    def _folder(self, name: str) -> Path:
        path = self._root / name
        path.mkdir()
        path.chmod(_MODE)
        return path

    def _own(self, name: str) -> Path:
        path = self._folder(name)
        if self.user is not None:
            os.chown(path, self.user, self.user)
        return path

    def folder(self, folder: str) -> tuple[Path, bool]:
        """Where an application's folder is shown, the same for all services, and whether it can be written there.

        What is written goes nowhere else. Raises OSError, also where its user may not read the folder.
        """
        if folder not in self._shown:
            place = self._folder(f"folder-{len(self._shown)}")
            lower, merged = self._folder(f"{place.name}/lower"), self._folder(f"{place.name}/merged")
            upper, work = self._own(f"{place.name}/upper"), self._own(f"{place.name}/work")
            self._show(Path(folder), lower)  # whose name needs no escapes
            try:
                namespaces.overlay(lower, upper, work, merged)
            except OSError:  # as some file systems refuse: then it can only be read
                self._shown[folder] = lower, False
            else:
                self._shown[folder] = merged, True
        return self._shown[folder]

    def read(self, path: str) -> Path:
        """What to show in the place of a path that it may read: as its own, or the path itself where that suffices."""
        if self.user is None or Path(path).is_relative_to(_SYSTEM) or not Path(path).exists():
            return Path(path)
        if path not in self._read:
            self._read[path] = self._as_own(Path(path), self._root / f"read-{len(self._read)}")
        return self._read[path]

    def _as_own(self, source: Path, target: Path) -> Path:
        assert self.user is not None
        target.mkdir() if source.is_dir() else target.touch()
        try:
            namespaces.bind_as(source, target, source.stat().st_uid, self.user)
        except OSError:  # as some kernels and file systems refuse: then it reads what everybody can
            return source
        return target

    def _show(self, source: Path, target: Path) -> None:
        """The folder as the application's own where the kernel can do that, else as it is."""
        if self.user is None:
            namespaces.bind(source, target, deep=True)
            return
        status = source.stat()
        try:
            namespaces.bind_as(source, target, status.st_uid, self.user)
        except OSError:
            if status.st_mode & _READABLE != _READABLE:
                why = "readable for its owner alone, and this kernel cannot show it to the application's user"
                raise PermissionError(errno.EACCES, why, str(source)) from None
            namespaces.bind(source, target, deep=True)


FIRST, LAST = 64_000, 64_999
HELD = 1
"""Processes of an own id that are not the application's: the one that holds it."""
_MOST_TRIES = 100
_FREE, _TAKEN = b"+", b"-"


def own_user(cid: int) -> int | None:
    """The user that a test's application runs as if DoDo is root; None without root: the user of DoDo.

    Raises as ``lease``.
    """
    return lease_user(FIRST + cid) if os.getuid() == 0 else None


def lease_user(preferred: int) -> int:
    """A user id that no process on the machine has, held by a child of this process until that is killed.

    The ``preferred`` one if it is free, else another. Raises OSError where none is, and where the kernel refuses.
    """
    known = _known_ids()
    for tries, user in enumerate(_in_turn(preferred)):
        if tries == _MOST_TRIES:
            break
        if user not in known and _is_held(user):
            return user
    raise OSError(errno.EAGAIN, f"no user id from {FIRST} to {LAST} is free: other processes on this machine have them")


def _in_turn(preferred: int) -> Iterator[int]:
    yield preferred
    yield from (user for user in range(FIRST, LAST + 1) if user != preferred)


def _known_ids(passwd: Path = Path("/etc/passwd")) -> set[int]:
    """The ids of the machine's own users."""
    with contextlib.suppress(OSError):
        fields = [line.split(":") for line in passwd.read_text(errors="replace").splitlines()]
        return {int(each[2]) for each in fields if len(each) > 2 and each[2].isdecimal()}
    return set()


def _is_held(user: int) -> bool:
    """Whether a new child is the only process with an id; it then stays. Raises OSError where it cannot be."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _hold(user, writer)
        finally:
            os._exit(1)
    os.close(writer)
    with os.fdopen(reader, "rb") as answers:
        answer = answers.read(4)
    if answer == _FREE:
        return True
    os.waitpid(child, 0)
    if answer == _TAKEN:
        return False
    number = int(answer or errno.EAGAIN)
    raise OSError(number, f"cannot take the user id {user}: {os.strerror(number)}")


def _hold(user: int, writer: int) -> None:
    """The child: it takes the id, then looks whether another has it, so that of two that try at once none is wrong."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.closerange(3, writer)
    os.closerange(writer + 1, 1 << 16)
    try:
        _, hard = resource.getrlimit(resource.RLIMIT_NPROC)
        resource.setrlimit(resource.RLIMIT_NPROC, (HELD + 1, hard))
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
        namespaces.die_with_parent(signal.SIGKILL)
    except OSError as error:
        os.write(writer, str(error.errno).encode())
        return
    if not _may_fork():
        os.write(writer, _TAKEN)
        return
    os.write(writer, _FREE)
    os.closerange(0, writer + 1)
    while True:
        signal.pause()


def _may_fork() -> bool:
    """Whether this user has no more processes than this one: with another the kernel refuses a second."""
    try:
        child = os.fork()
    except BlockingIOError:
        return False
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    return True
