"""The files that a test needs, to be copied beside its compiled output."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MAX_FILES = 5_000
MAX_BYTES = 2 << 30


class FilesError(ValueError):
    """Files of a test that cannot be copied."""


@dataclass(frozen=True, order=True)
class FileCopy:
    """A file of the registry, and where it goes below ``files/``."""

    target: str
    source: Path


def copies(path: Path, root: Path) -> list[FileCopy]:
    """The file, or all files of the folder, below ``root``; raises FilesError for links out of it or too many."""
    root = root.resolve()
    found: list[FileCopy] = []
    size = 0
    for file in _files(path):
        resolved = file.resolve()
        if not resolved.is_relative_to(root):
            raise FilesError(f"'{file.relative_to(root)}' is a symbolic link that leaves the registry")
        size += resolved.stat().st_size
        found.append(FileCopy(file.relative_to(root).as_posix(), resolved))
        if len(found) > MAX_FILES or size > MAX_BYTES:
            raise FilesError(f"'{path.relative_to(root)}' holds more than {MAX_FILES} files or {MAX_BYTES >> 30} GiB")
    return found


def _files(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    for entry in sorted(path.rglob("*")):
        hidden = any(part.startswith(".") or part == "__pycache__" for part in entry.relative_to(path).parts)
        if entry.is_file() and not hidden:
            yield entry
