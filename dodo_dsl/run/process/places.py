"""What a sandbox prepares once for the application: its folders, and under root a user id that nobody else has.

Folders are ``/tmp``, a home, the application's own with writes apart, and what it reads. The user's umask decides about
none of them: the application's user must enter them.

The kernel counts processes, inotify instances and bytes of message queues by user, on the whole machine: in all
containers and namespaces, whose processes this one may not see. So an id is drawn from millions.
"""

import contextlib
import errno
import os
import secrets
import tempfile
from pathlib import Path

from dodo_dsl.run.process import namespaces

_MODE = 0o755
_SYSTEM = Path("/usr")
"""What packages of the system install: everybody can read it."""


class Places:
    """Folders that belong to ``user``, None for that of this process. To be made by a sandbox with own mounts."""

    def __init__(self, folder: str, user: int | None) -> None:
        """``folder`` is the application's; raises OSError."""
        self.user = user
        """The user that the application runs as; None for the user of this process."""
        self._root = Path(tempfile.mkdtemp(prefix="dodo-application-", dir=namespaces.SHARED[0]))  # the sandbox's own
        namespaces.mount("tmpfs", self._root, "size=1g,mode=0755")
        self.home = self._made("home", is_own=True)
        self.shared = {str(place): self._made(place.name) for place in namespaces.SHARED if place.is_dir()}
        """``/tmp`` and ``/dev/shm`` by their names, without the host's folders that are mounted there."""
        for place, target in self.shared.items():
            namespaces.bind(Path(place), target, deep=False)
        self.namespace = None if user is None else namespaces.user_namespace(f"{user} {user} 1\n", user)
        """The descriptor of that user's own namespace, which bubblewrap enters where it is not to make one."""
        self.mounted = tuple(str(path) for place in self.shared for path in Path(place).iterdir() if path.is_mount())
        """What is mounted there, and must be a mount to the application as well: no other folder can be removed."""
        self._read: dict[str, Path] = {}
        self.folder, self.writable = self._overlaid(Path(folder))
        """Where its folder is shown, the same for all services; what is written there goes nowhere else."""

    def _made(self, name: str, is_own: bool = False) -> Path:
        path = self._root / name
        path.mkdir()
        path.chmod(_MODE)
        if is_own and self.user is not None:
            os.chown(path, self.user, self.user)
        return path

    def _overlaid(self, folder: Path) -> tuple[Path, bool]:
        lower, merged = self._made("lower"), self._made("merged")
        upper, work = self._made("upper", is_own=True), self._made("work", is_own=True)
        self._show(folder, lower)
        try:
            namespaces.mount("overlay", merged, f"lowerdir={lower},upperdir={upper},workdir={work}")
        except OSError:  # as some file systems refuse: then it can only be read
            return lower, False
        return merged, True

    def read(self, path: str) -> Path:
        """Where a path is shown that it may read, as its own where the kernel can do that; or the path itself."""
        if self.user is None or Path(path).is_relative_to(_SYSTEM) or not Path(path).exists():
            return Path(path)
        if path not in self._read:
            target = self._root / f"read-{len(self._read)}"
            target.mkdir() if Path(path).is_dir() else target.touch()
            self._show(Path(path), target)
            self._read[path] = target
        return self._read[path]

    def _show(self, source: Path, target: Path) -> None:
        """As the application's own, where the kernel and the file system can do that."""
        if self.user is not None:
            with contextlib.suppress(OSError):
                namespaces.bind_as(source, target, source.stat().st_uid, self.user)
                return
        namespaces.bind(source, target, deep=True)


OWN_USERS = (range(1_879_048_192, 2_147_483_648), range(64_000, 65_000))
"""Ids that nobody on a machine has, and those to take where a container has no others."""


def own_user() -> int | None:
    """The user that a test's application runs as if DoDo is root; None without root: the user of DoDo."""
    if os.getuid() != 0:
        return None
    rows = (line.split() for line in Path("/proc/self/uid_map").read_text().splitlines())
    mapped = [range(int(first), int(first) + int(count)) for first, _, count in rows]
    there = (each for each in OWN_USERS if any(each[0] in ids and each[-1] in ids for ids in mapped))
    if users := next(there, None):
        return secrets.choice(users)
    raise OSError(errno.EPERM, f"this container has no user ids from {OWN_USERS[1][0]} to {OWN_USERS[1][-1]}")
