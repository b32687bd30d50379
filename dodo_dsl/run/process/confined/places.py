"""What a sandbox prepares once for the application: its view of ``/tmp``, a home, and its folder with writes apart."""

import contextlib
import os
import tempfile
from pathlib import Path

from dodo_dsl.run.process import namespaces

_SIZE = "size=1g,mode=0755"


class Places:
    """Folders that belong to ``user``, None for that of this process. To be made by a sandbox with own mounts."""

    def __init__(self, user: int | None) -> None:
        self._user = user
        self._root = Path(tempfile.mkdtemp(prefix="dodo-application-"))
        namespaces.mount_tmpfs(self._root, _SIZE)
        self.home = self._own("home")
        self.tmp = self._root / "tmp"
        self.tmp.mkdir()
        namespaces.bind(Path("/tmp"), self.tmp, deep=False)  # without the folders of the host's that are mounted there
        self._written: dict[str, Path] = {}

    def _own(self, name: str) -> Path:
        path = self._root / name
        path.mkdir(parents=True)
        if self._user is not None:
            os.chown(path, self._user, self._user)
        return path

    def _show(self, source: Path, target: Path) -> None:
        """The folder as the application's own where the kernel can do that, else as it is."""
        if self._user is not None:
            with contextlib.suppress(OSError):
                namespaces.bind_as(source, target, source.stat().st_uid, self._user)
                return
        namespaces.bind(source, target, deep=True)

    def written(self, folder: str) -> Path | None:
        """A copy of a folder on write, the same for all services; None where the kernel cannot mount one."""
        if folder not in self._written:
            name = f"folder-{len(self._written)}"
            lower, merged = self._root / name / "lower", self._root / name / "merged"
            upper, work = self._own(f"{name}/upper"), self._own(f"{name}/work")
            for path in (lower, merged):
                path.mkdir()
            self._show(Path(folder), lower)  # whose name needs no escapes
            try:
                namespaces.overlay(lower, upper, work, merged)
            except OSError:
                return None
            self._written[folder] = merged
        return self._written[folder]
