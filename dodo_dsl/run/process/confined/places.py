"""What a sandbox prepares once for the application: ``/tmp``, a home, its folder with writes apart, what it reads.

The user's umask decides about none of these folders: the application's user must enter them.
"""

import errno
import os
import stat
import tempfile
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
        """Who the application is; None for the user of this process."""
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
