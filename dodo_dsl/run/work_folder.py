"""Where a run's tests are compiled: a folder that is gone afterwards, or with the next run."""

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
    """Where a run's tests are compiled; the next run removes it should this one be killed."""

    path: Path
    lease: leases.Lease
    kept: bool = False

    def __enter__(self) -> Self:
        self.path.mkdir(mode=0o755)
        return self

    def __exit__(self, *_: object) -> None:
        if self.kept:
            self.lease.leave()
        else:
            _remove(self.path, self.lease)


def work_folder() -> WorkFolder:
    """A folder of a fresh name, leased."""
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
    """What cannot be removed now keeps its record, for the next run to try."""
    shutil.rmtree(folder, ignore_errors=True)
    lease.leave() if folder.exists() else lease.release()
