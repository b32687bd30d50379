"""Which files below some folders are saved, found by looking at their times: the same on every file system.

Editors replace files, write beside them and rename, and network file systems and containers tell nobody, which is why
nothing waits for the kernel's notices. Looking at a thousand files takes some milliseconds.
"""

import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

MOST_FILES = 20_000
"""Further ones are not looked at."""
_SKIPPED = {"__pycache__", "node_modules"}

Seen = dict[Path, tuple[int, int]]
"""Time of change in ns and size in bytes of each file."""


def seen(roots: Iterable[Path], skipped: Collection[Path]) -> Seen:
    """The files below the roots but for hidden ones, and those below folders of ``skipped``. All paths are resolved."""
    found: Seen = {}
    for root in roots:
        for entry in _below(root, skipped):
            if len(found) == MOST_FILES:
                return found
            try:
                status = entry.stat()
            except OSError:  # it is gone
                continue
            found[Path(entry.path)] = status.st_mtime_ns, status.st_size
    return found


def saved(before: Seen, after: Seen) -> set[Path]:
    """Files that are new, changed or gone."""
    return {path for path in {*before, *after} if before.get(path) != after.get(path)}


def _below(folder: Path, skipped: Collection[Path]) -> Iterator["os.DirEntry[str]"]:
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith(".") or entry.name in _SKIPPED or entry.name.endswith("~"):
            continue
        if entry.is_dir(follow_symlinks=False):
            if Path(entry.path) not in skipped:
                yield from _below(Path(entry.path), skipped)
        elif entry.is_file():
            yield entry
