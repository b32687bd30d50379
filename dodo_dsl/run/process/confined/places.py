"""What a sandbox prepares once for the application: its view of ``/tmp``, a home, and its folder with writes apart."""

import errno
import os
import stat
import tempfile
from pathlib import Path

from dodo_dsl.run.process import namespaces

_SIZE = "size=1g,mode=0755"
_READABLE = stat.S_IROTH | stat.S_IXOTH


class Places:
    """Folders that belong to ``user``, None for that of this process. To be made by a sandbox with own mounts."""

    def __init__(self, user: int | None) -> None:
        self.user = user
        """Who the application is; None for the user of this process."""
        self._root = Path(tempfile.mkdtemp(prefix="dodo-application-"))
        namespaces.mount_tmpfs(self._root, _SIZE)
        self.home = self._own("home")
        self.tmp = self._root / "tmp"
        self.tmp.mkdir()
        namespaces.bind(Path("/tmp"), self.tmp, deep=False)  # without the folders of the host's that are mounted there
        self._shown: dict[str, tuple[Path, bool]] = {}

    def _own(self, name: str) -> Path:
        path = self._root / name
        path.mkdir(parents=True)
        if self.user is not None:
            os.chown(path, self.user, self.user)
        return path

    def folder(self, folder: str) -> tuple[Path, bool]:
        """Where an application's folder is shown, the same for all services, and whether it can be written there.

        What is written goes nowhere else. Raises OSError, also where its user may not read the folder.
        """
        if folder not in self._shown:
            place = self._root / f"folder-{len(self._shown)}"
            lower, merged = place / "lower", place / "merged"
            upper, work = self._own(f"{place.name}/upper"), self._own(f"{place.name}/work")
            for path in (lower, merged):
                path.mkdir()
            self._show(Path(folder), lower)  # whose name needs no escapes
            try:
                namespaces.overlay(lower, upper, work, merged)
            except OSError:  # as some file systems refuse: then it can only be read
                self._shown[folder] = lower, False
            else:
                self._shown[folder] = merged, True
        return self._shown[folder]

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
