"""The files that a test needs, to be copied next to its compiled output.

Large files that several tests need stand once, in the folder ``SHARED`` next to the tests; a test has links to them.
"""

import hashlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dodo_dsl.opendlv import regular_file

LARGE = 1 << 20
"""Bytes from which a file is not copied for each test that needs it."""
SHARED = "_files"
"""No test may be called so."""
_NAME = re.compile(r"([0-9a-f]{64})-[A-Za-z0-9._-]{1,100}")
_OTHER = re.compile(r"[^A-Za-z0-9._-]")


class FilesError(ValueError):
    usage = True


@dataclass(frozen=True, order=True)
class FileCopy:
    """A file of the registry, and where it goes below ``files/``.

    ``shared`` is its name in ``SHARED``, to which ``files/`` then has a link; empty for a file of the test alone. It
    begins with the content's SHA-256.
    """

    target: str
    source: Path
    shared: str = ""

    @property
    def link(self) -> str:
        """The text of the test's link to the shared file; in containers from ``/dodo/files`` to ``/SHARED``."""
        return f"{'../' * (self.target.count('/') + 2)}{SHARED}/{self.shared}"


def is_shared_name(name: str) -> bool:
    return _NAME.fullmatch(name) is not None


def standing_once(tests: Mapping[str, Sequence[FileCopy]]) -> dict[str, tuple[FileCopy, ...]]:
    """The files of tests by slug, with large ones that several need shared; raises OSError."""
    needed = Counter(source for copied in tests.values() for source in {copy.source for copy in copied})
    large = [source for source, number in needed.items() if number > 1 and source.stat().st_size >= LARGE]
    names = {source: f"{_digest(source)}-{_OTHER.sub('_', source.name)[-100:]}" for source in large}
    return {
        slug: tuple(replace(copy, shared=names.get(copy.source, "")) for copy in copied)
        for slug, copied in tests.items()
    }


def file_problem(folder: Path, shared: Mapping[str, str]) -> str:
    """The first of the shared files that the compiled test in ``folder`` lacks; empty if all are there.

    ``shared`` has their names by what the test calls them.
    """
    for target, name in shared.items():
        if not (folder / "files" / target).is_file():
            where = f"'{folder.parent / SHARED / name}', which has to stay beside the compiled tests"
            return f"'{target}' is missing: it is a link to {where}; compile the test again"
    return ""


def _digest(path: Path) -> str:
    with regular_file.opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
