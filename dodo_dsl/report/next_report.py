"""A report that is drawn beside the run, and takes the place of the one before when it is whole.

It is written in a hidden folder inside the report's, as only there a rename is sure to work. A run that is killed
leaves the report before as it was, and its own files for the next run to remove. What it has of a test is drawn as soon
as the test has ended, beside the tests that still run.
"""

import contextlib
import fcntl
import os
import secrets
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Self

from dodo_dsl.outcome import NEXT_REPORT, Outcome
from dodo_dsl.report import comparison, results
from dodo_dsl.report.report_folder import OF_MACHINE, Drawable, draw_test, forget


class NextReport:
    """The report that is written in ``folder``, and becomes that in ``place``.

    ``slugs`` are those of its tests, ``others`` those of the report before that are in it, too.
    """

    def __init__(self, place: Path, folder: Path, slugs: Sequence[str], others: Collection[str]) -> None:
        self.place, self.folder = place, folder
        self.stays = False
        """Whether the folder is left as it is."""
        self._slugs, self._others = slugs, others

    def link_others(self) -> None:
        """Makes the files of the other tests seen from this report."""
        for slug in self._others:
            if (self.place / slug).is_dir() and not (self.folder / slug).exists():
                (self.folder / slug).symlink_to(self.place / slug, target_is_directory=True)

    def take_place(self) -> int:
        """Replaces the report before; returns how many of its tests are not in this one. Raises OSError."""
        gone = forget(self.place, self._slugs, self._others)
        for name in OF_MACHINE:
            (self.place / name).unlink(missing_ok=True)
        comparison.write_markdown(self.place, None)
        entries = [entry for entry in self.folder.iterdir() if not entry.is_symlink()]
        for entry in sorted(entries, key=lambda entry: (entry.name == results.FILE_NAME, entry.is_file())):
            _move(entry, self.place / entry.name)
        return gone


class ReportInPlace(NextReport):
    """A report that is written where it stays, without that before."""

    def __init__(self, place: Path, slugs: Sequence[str], others: Collection[str]) -> None:
        super().__init__(place, place, slugs, others)
        self._gone = forget(place, slugs, others)
        self.stays = True

    def take_place(self) -> int:
        return self._gone


@contextlib.contextmanager
def next_report(
    place: Path, slugs: Sequence[str], others: Collection[str] = (), in_place: bool = False
) -> Iterator[NextReport]:
    """A report to write while this lasts; what has not taken its place by then is removed.

    Where there is no room for another folder, or ``in_place`` is wanted, the report before goes at once.
    """
    _remove_left_behind(place)
    folder = place / f"{NEXT_REPORT}{secrets.token_hex(4)}"
    try:
        if not in_place:
            folder.mkdir()
    except OSError:
        in_place = True
    if in_place:
        yield ReportInPlace(place, slugs, others)
        return
    report = NextReport(place, folder, slugs, others)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _locked(descriptor)
        yield report
    finally:
        os.close(descriptor)
        if not report.stays:
            shutil.rmtree(folder, ignore_errors=True)


def _remove_left_behind(place: Path) -> None:
    """What killed runs left, whose locks ended with them."""
    for folder in place.glob(f"{NEXT_REPORT}*"):
        with contextlib.suppress(OSError):
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                if _locked(descriptor):
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Whether nobody else holds the lock, as far as the file system has locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _move(source: Path, target: Path) -> None:
    """Renames a file or folder; into a folder that holds what others put there, its entries one by one."""
    if source.is_dir() and not source.is_symlink() and target.is_dir() and not target.is_symlink():
        for entry in source.iterdir():
            _move(entry, target / entry.name)
    else:
        source.replace(target)


class Drawings:
    """The pictures and pages of tests in a report's folder, drawn one after the other in a separate thread.

    What was begun is whole when the context ends; after an exception, no further one begins.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._pool = ThreadPoolExecutor(1, "drawing")
        self._begun: dict[str, Future[list[str]]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, _error: object, _trace: TracebackType | None) -> None:
        self._pool.shutdown(cancel_futures=kind is not None)

    def begin(self, outcome: Outcome, test: Drawable) -> None:
        """Draws the test of this outcome, which is final."""
        self._begun[outcome.slug] = self._pool.submit(draw_test, self._folder, outcome, test)

    def problems(self) -> Mapping[str, Sequence[str]]:
        """The slugs of all tests that were drawn, with sentences on what could not be."""
        return {slug: future.result() for slug, future in self._begun.items()}
