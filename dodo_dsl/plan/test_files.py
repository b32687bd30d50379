"""The files that a test needs, to be copied next to its compiled output.

Large files that several tests need stand once, in the folder ``SHARED`` next to the tests; a test has links to them.
"""

import functools
import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from dodo_dsl.opendlv import regular_file

LARGE = 1 << 20
"""Bytes from which a file is not copied for each test that needs it."""
SHARED = "_files"
"""No test may be called so."""
_NAME = re.compile(r"([0-9a-f]{64})-[A-Za-z0-9._-]{1,100}")
_OTHER = re.compile(r"[^A-Za-z0-9._-]")
Key = TypeVar("Key", int, str)
_POINTER = b"version https://git-lfs.github.com/spec/"


class FilesError(ValueError):
    """Files of a test that cannot be copied."""


@dataclass(frozen=True, order=True)
class FileCopy:
    """A file of the registry, and where it goes below ``files/``.

    ``shared`` is its name in ``SHARED``, to which ``files/`` then has a link; empty for a file of the test alone. It
    begins with the content's SHA-256. Where ``is_linked``, a link to the repository's file stands there, and no copy.
    """

    target: str
    source: Path
    shared: str = ""
    is_linked: bool = False

    @property
    def link(self) -> str:
        """The text of the test's link to the shared file."""
        return link(self.target, self.shared)


def link(target: str, shared: str) -> str:
    """What a link at ``target`` below ``files/`` says; in containers it leads to ``/SHARED``, from ``/dodo/files``."""
    return f"{'../' * (target.count('/') + 2)}{SHARED}/{shared}"


def is_shared_name(name: str) -> bool:
    """Whether DoDo calls a shared file so."""
    return _NAME.fullmatch(name) is not None


def standing_once(
    tests: Mapping[str, Sequence[FileCopy]], is_linked: Callable[[Path], bool] = lambda _: False
) -> dict[str, tuple[FileCopy, ...]]:
    """The files of tests by slug, with large ones that several need shared; raises OSError.

    Files of one content are one file, whatever they are called. Large files for which ``is_linked`` are shared even
    where a single test needs them.
    """
    sizes = {source: source.stat().st_size for source in {copy.source for found in tests.values() for copy in found}}
    large = {source: size for source, size in sizes.items() if size >= LARGE}
    linked = {source for source in large if is_linked(source)}
    by_size = _needed(tests, large)
    digests = {s: _digest(s) for s, size in large.items() if s in linked or len(by_size[size]) > 1}
    by_content = _needed(tests, digests)
    found: dict[str, FileCopy] = {}
    for source, digest in sorted(digests.items(), key=lambda one: (one[0] not in linked, one[0])):
        if source in linked or len(by_content[digest]) > 1:
            name = f"{digest}-{_OTHER.sub('_', source.name)[-100:]}"
            found.setdefault(digest, FileCopy("", source, name, source in linked))
    shared = {source: found[digest] for source, digest in digests.items() if digest in found}
    return {
        slug: tuple(replace(shared[c.source], target=c.target) if c.source in shared else c for c in copied)
        for slug, copied in tests.items()
    }


def _needed(tests: Mapping[str, Sequence[FileCopy]], keys: Mapping[Path, Key]) -> Mapping[Key, set[str]]:
    """The slugs of the tests that need a file with each key."""
    found: dict[Key, set[str]] = defaultdict(set)
    for slug, copied in tests.items():
        for copy in copied:
            if copy.source in keys:
                found[keys[copy.source]].add(slug)
    return found


def file_problem(folder: Path, shared: Mapping[str, str]) -> str:
    """The first thing that is wrong with the shared files of the compiled test in ``folder``; empty if all are right.

    ``shared`` has their names by what the test calls them. A link's file has to have the content that was compiled.
    """
    for target, name in shared.items():
        path = folder.parent / SHARED / name
        if not path.is_file():
            return f"'{target}' is missing: {_missing(path)}"
        if path.is_symlink() and _digest(path) != name[:64]:
            return f"'{target}' is not what was compiled: {_other(path)}"
        if not (folder / "files" / target).is_file():
            return f"'{target}' is missing in '{folder / 'files'}'; compile the test again"
    return ""


def _missing(path: Path) -> str:
    if not path.is_symlink():
        return f"'{path.parent}' belongs to the compiled tests next to it, and has to stay with them"
    return f"'{_repository_file(path)}' is not in this checkout; commit it, or compile with --files artifact"


def _other(path: Path) -> str:
    with regular_file.opened(path) as file:
        is_pointer = file.read(len(_POINTER)) == _POINTER
    if is_pointer:
        why = "is a pointer of Git LFS: install git-lfs where this runs, and leave GIT_LFS_SKIP_SMUDGE unset"
    else:
        why = f"has the SHA-256 {_digest(path)[:12]}..., expected {path.name[:12]}...: check out the same commit"
    return f"'{_repository_file(path)}' {why}"


def _repository_file(path: Path) -> str:
    return os.path.relpath(path.parent / path.readlink())


def _digest(path: Path) -> str:
    status = path.stat()
    return _digest_of(path, status.st_size, status.st_mtime_ns)


@functools.lru_cache(maxsize=256)
def _digest_of(path: Path, _size: int, _time: int) -> str:
    with regular_file.opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
