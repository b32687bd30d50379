"""Tests of a report that are drawn beside the run, and take their place in the report when all of it is there.

They are written in a hidden folder inside the report's, as only there a rename is sure to work. A run that is killed
leaves the report before as it was, and its own files for the next run to remove.
"""

import contextlib
import fcntl
import os
import secrets
import shutil
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.outcome import NEXT_REPORT
from dodo_dsl.report.files import forget


@dataclass
class NextReport:
    """Tests that are written in ``folder``, and become those of the report in ``place``."""

    place: Path
    folder: Path

    def take_place(self, slugs: Sequence[str], others: Collection[str] = ()) -> None:
        """Replaces the tests of the report before but for ``others``; raises OSError."""
        if self.folder != self.place:
            forget(self.place, slugs, others)
            for entry in sorted(self.folder.iterdir()):
                _move(entry, self.place / entry.name)


@contextlib.contextmanager
def next_report(place: Path, slugs: Sequence[str] = (), in_place: bool = False) -> Iterator[NextReport]:
    """Tests to write while this lasts; what has not taken its place by then is removed.

    Where there is no room for another folder, or ``in_place`` is wanted, what the report has of ``slugs`` goes at once.
    """
    _remove_left_behind(place)
    folder = place / f"{NEXT_REPORT}{secrets.token_hex(4)}"
    try:
        if not in_place:
            folder.mkdir()
    except OSError:
        in_place = True
    if in_place:
        forget(place, slugs)
        yield NextReport(place, place)
        return
    with _locked(folder):
        try:
            yield NextReport(place, folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _remove_left_behind(place: Path) -> None:
    """What killed runs left, whose locks ended with them."""
    for folder in place.glob(f"{NEXT_REPORT}*"):
        with contextlib.suppress(OSError), _locked(folder) as is_free:
            if is_free:
                shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Whether nobody else holds the lock of a folder, as far as the file system has locks."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            yield False
            return
        yield True
    finally:
        os.close(descriptor)


def _move(source: Path, target: Path) -> None:
    """Renames a file or folder; into a folder that holds what others put there, its entries one by one."""
    if source.is_dir() and not source.is_symlink() and target.is_dir() and not target.is_symlink():
        for entry in source.iterdir():
            _move(entry, target / entry.name)
    else:
        source.replace(target)
