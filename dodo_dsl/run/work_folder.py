"""The temporary folders of a run, of which the next run removes those of a killed one.

In one its tests are compiled. Those where the services of a test meet are in one place, which is hidden from all
applications: so none reaches another test's.
"""

import contextlib
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.run import leases
from dodo_dsl.state_folder import secured

FOLDER_PREFIX = "dodo-run-"


@dataclass
class WorkFolder:
    path: Path
    lease: leases.Lease
    kept: bool = False


@contextlib.contextmanager
def work_folder() -> Iterator[WorkFolder]:
    """A leased folder that exists within the block, and stays where ``kept`` was set."""
    token = secrets.token_hex(4)
    path = Path(tempfile.gettempdir()).resolve() / f"{FOLDER_PREFIX}{token}"
    lease = leases.try_lease(f"{leases.RUN}{token}", {"folder": str(path)})
    assert lease is not None, "a fresh name is free"
    folder = WorkFolder(path, lease)
    path.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        lease.leave() if folder.kept else _remove(path, lease)


def reap_folders() -> None:
    for lease in leases.orphans(leases.RUN):
        folder = Path(str(lease.left.get("folder", "")))
        if folder.name == f"{FOLDER_PREFIX}{lease.name.removeprefix(leases.RUN)}":
            _remove(folder, lease)
        else:
            lease.release()


def _channels() -> Path:
    return Path(tempfile.gettempdir()).resolve() / f"dodo-channels-{os.geteuid()}"


@contextlib.contextmanager
def meeting_place(work: Path, keep: bool) -> Iterator[str]:
    """A folder where the services of a test of the run with a ``work`` folder meet; ``keep`` leaves it."""
    folder = ""
    while not folder:
        with contextlib.suppress(FileNotFoundError):  # another run, which has ended, has just removed the place
            folder = tempfile.mkdtemp(prefix=f"{work.name}-", dir=secured(_channels()))
    try:
        yield folder
    finally:
        if not keep:
            _clear(Path(folder))


def _clear(*folders: Path) -> None:
    """Removes folders, and the place of all channels, unless a test has one there."""
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        _channels().rmdir()


def _remove(folder: Path, lease: leases.Lease) -> None:
    """Removes a folder; where that fails its record stays, and the next run tries again."""
    _clear(folder, *_channels().glob(f"{folder.name}-*"))
    lease.leave() if folder.exists() else lease.release()
