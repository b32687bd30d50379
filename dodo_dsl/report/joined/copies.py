"""Copies of a test's files from one report into another: those that reports hold, no symlinks, no more than fits."""

import errno
import io
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.plan.recorder_service import PICTURES_FILE, RECORDING, SNAPSHOT
from dodo_dsl.report.report_folder import ATTEMPTS, SANDBOX_LOG, TRAJECTORY
from dodo_dsl.report.viewer import names as viewer

MOST_BYTES = 16 << 30
"""Of all files of a joined report."""
MOST_FILES = 2000
"""In a folder; further ones are left out."""
_PART = 1 << 20
_FILES = {RECORDING, PICTURES_FILE, SNAPSHOT, TRAJECTORY, SANDBOX_LOG, *viewer.VIDEOS}
_LOG = re.compile(r"[^/\0]+\.(log|times|judged)")
_ATTEMPT = re.compile(r"[1-9][0-9]{0,3}")


class NotCopied(ValueError):
    """Why a file is left out, in a few words."""


@dataclass
class Room:
    """How many bytes may still be copied."""

    left: int = MOST_BYTES


def copy_test(source: Path, target: Path, room: Room) -> Iterator[str]:
    """Copies the files of a test, without its page, and yields a sentence on each that is left out; raises OSError.

    ``target`` is a folder that no one else writes to.
    """
    yield from _copy_folder(source, target, room)
    for attempt in _entries(source / ATTEMPTS):
        if _ATTEMPT.fullmatch(attempt.name) and is_folder(attempt):
            yield from _copy_folder(attempt, target / ATTEMPTS / attempt.name, room)
    for path in (source / viewer.LOGS, source / ATTEMPTS):
        if path.is_symlink():
            yield left_out(path, "it is a symlink")


def left_out(path: Path, why: object) -> str:
    return f"{path} is left out: {why}"


def is_folder(path: Path) -> bool:
    """Whether it is one itself, not a symlink to one."""
    try:
        return stat.S_ISDIR(path.lstat().st_mode)
    except (OSError, ValueError):
        return False


def opened(path: Path) -> io.FileIO:
    """A regular file to read; raises NotCopied for anything else, symlinks included."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError as error:
        raise NotCopied("it is a symlink" if error.errno == errno.ELOOP else str(error.strerror)) from None
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return io.FileIO(descriptor, "rb")
    os.close(descriptor)
    raise NotCopied("it is not a regular file")


def _copy_folder(source: Path, target: Path, room: Room) -> Iterator[str]:
    found = [path for path in _entries(source) if path.name in _FILES]
    found += [path for path in _entries(source / viewer.LOGS) if _LOG.fullmatch(path.name)]
    if len(found) > MOST_FILES:
        yield f"{source} has {len(found)} files, of which {len(found) - MOST_FILES} are left out"
    for path in found[:MOST_FILES]:
        try:
            _copy(path, target / path.relative_to(source), room)
        except NotCopied as problem:
            yield left_out(path, problem)


def _entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if is_folder(folder) else []


def _copy(source: Path, target: Path, room: Room) -> None:
    with opened(source) as file:
        size = os.fstat(file.fileno()).st_size
        if size > room.left:
            raise NotCopied(f"its {size} bytes would make the report larger than {MOST_BYTES >> 30} GiB")
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as copy:
            while size > 0 and (part := file.read(min(_PART, size))):
                copy.write(part)
                size -= len(part)
                room.left -= len(part)
