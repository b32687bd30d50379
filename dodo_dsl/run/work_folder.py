"""The temporary folder in which a run's tests are compiled; the next run removes that of a killed one."""

import secrets
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dodo_dsl.run import leases

FOLDER_PREFIX = "dodo-run-"


@dataclass
class WorkFolder:
    """A leased folder that exists within the block, and stays where ``kept`` was set."""

    path: Path
    lease: leases.Lease
    kept: bool = False

    def __enter__(self) -> Self:
        self.path.mkdir(mode=0o700)
        return self

    def __exit__(self, *_: object) -> None:
        if self.kept:
            self.lease.leave()
        else:
            _remove(self.path, self.lease)


def work_folder() -> WorkFolder:
    """A folder with a fresh name, leased."""
    token = secrets.token_hex(4)
    path = Path(tempfile.gettempdir()).resolve() / f"{FOLDER_PREFIX}{token}"
    lease = leases.try_lease(f"{leases.RUN}{token}", {"folder": str(path)})
    assert lease is not None, "a fresh name is free"
    return WorkFolder(path, lease)


def reap_folders() -> None:
    """Removes the folders of killed runs."""
    for lease, about in leases.orphans(leases.RUN):
        folder = Path(str(about.get("folder", "")))
        if folder.name == f"{FOLDER_PREFIX}{lease.name.removeprefix(leases.RUN)}":
            _remove(folder, lease)
        else:
            lease.release()


def _remove(folder: Path, lease: leases.Lease) -> None:
    """Removes a folder; where that fails its record stays, and the next run tries again."""
    shutil.rmtree(folder, ignore_errors=True)
    lease.leave() if folder.exists() else lease.release()
