"""What keeps tests of the process backend apart: slots, namespaces to enter, and the Python path."""

import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Self

from dodo_dsl import package_data
from dodo_dsl.run.process import namespaces

SLOT_VARIABLE = "DODO_SLOT"
"""Environment variable of a test's processes on the host: the name of its slot, by which leftovers are found."""


@dataclass(frozen=True)
class Slot:
    """A CID, a name, a prefix of shared memory, the descriptors of the leases, and where the test's services meet.

    Name and prefix are given only on the host.
    """

    cid: int
    name: str = ""
    memory_prefix: str = ""
    descriptors: tuple[int, ...] = ()
    channel: str = ""


_VARIABLES = ("PATH", "LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV", "HOME", "DODO_FIRMWARE")
"""Where DoDo's services find programs, libraries, settings and the emulated rig; no other variable shows a folder."""


@dataclass(frozen=True)
class Entered:
    """A process of the container on this machine, 0 for own namespaces, and folders of ``/tmp`` that the test needs."""

    process: int
    shown: tuple[Path, ...] = ()

    @classmethod
    def with_own(cls, process: int, *needed: Path) -> Self:
        """With what in ``/tmp`` and ``/dev/shm`` holds ``needed`` paths, Python, DoDo, or those of ``_VARIABLES``."""
        own = (Path(sys.prefix), Path(sys.base_prefix), *(Path(place) for place in sys.path if place))
        given = named_paths(os.environ.get(name, "") for name in _VARIABLES)
        names = {Path(place(path)) for path in (*needed, *own, *given) for place in (os.path.abspath, os.path.realpath)}
        above = {path for name in names for path in (name, *name.parents)}
        return cls(process, tuple(sorted(path for path in above if path.parent in namespaces.SHARED)))


def in_memory(data: bytes) -> BinaryIO:
    """A file without a name, to be read from its beginning."""
    file = os.fdopen(os.memfd_create("dodo"), "w+b")
    file.write(data)
    file.seek(0)
    return file


def named_paths(words: Iterable[str]) -> list[Path]:
    """The whole paths among words, each of which may have several, as ``PATH`` does."""
    return [
        Path(name) for word in words for name in word.split(os.pathsep) if name.startswith("/") and "\0" not in name
    ]


def package_path(own: Iterable[Path] = ()) -> str:
    """``PYTHONPATH`` of services and sandbox: the folders of ``services`` and of ``dodo_dsl``, and ``own`` ones."""
    ours = (package_data.root(), Path(__file__).resolve().parents[3])
    places = [*map(str, (*ours, *own)), os.environ.get("PYTHONPATH", "")]
    return os.pathsep.join(dict.fromkeys(p for p in places if p))
