"""What a service of the application sees and may use, as the runner tells its sandbox."""

import functools
import os
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_PACKAGE = Path(__file__).resolve().parents[3]
INTERPRETER = tuple(dict.fromkeys((sys.prefix, sys.base_prefix)))
"""The folders of this Python, which starts the application's programs."""
SYSTEM = ("/usr", "/etc", "/opt", "/sys/devices/system")
"""What every application sees of the machine."""
_OF_TESTS = ("tests_registry", "tests", "templates", "benchmarks", "docs", "generated", "dodo-report", "build", "dist")
"""Folders of a checkout with tests, or with what was made of them."""


@dataclass(frozen=True)
class Confinement:
    """``folder`` is the application's own, ``reads`` is what else it may read, ``hidden`` lies in them and stays out.

    With ``isolation`` ``host`` it has only processes of its own, and sees what DoDo sees but for ``masked`` devices.
    ``cid`` says which user id of its own is tried first, where DoDo runs as root.
    """

    folder: str
    isolation: str
    cid: int
    reads: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    masked: tuple[str, ...] = ()


def confinement(folder: Path, isolation: str, cid: int, limits: SandboxLimits, hidden: Iterable[Path]) -> Confinement:
    """The confinement of an application; of the ``hidden`` paths, and DoDo's own, those matter that it would see."""
    reads = [str((folder / Path(path).expanduser()).resolve()) for path in limits.reads]
    every = tuple(dict.fromkeys([*INTERPRETER, str(_PACKAGE), *reads]))
    inside = _inside((*hidden, *own_data()), (*SYSTEM, *every, str(folder)))
    return Confinement(str(folder), isolation, cid, every, tuple(dict.fromkeys(inside)), limits)


def _inside(hidden: Iterable[Path], shown: Iterable[str]) -> Iterator[str]:
    """The paths below those that are shown, by each of their names."""
    real = {Path(path): Path(os.path.realpath(path)) for path in shown}
    for path in hidden:
        for name, place in real.items():
            if path != place and path.is_relative_to(place):
                yield str(name / path.relative_to(place))


@functools.cache
def own_data() -> tuple[Path, ...]:
    """Where DoDo's tests lie, whichever way it is installed, also beside other Pythons that an application sees."""
    root = package_data.root()
    optional = [path for path in _entries(Path("/opt")) if path.is_dir()]
    prefixes = [*map(Path, (*INTERPRETER, "/usr", "/usr/local")), *optional]
    found = [data for prefix in prefixes for data in prefix.glob(package_data.INSTALLED)]
    found += [Path(place, "dodo_dsl", "_data") for place in sys.path]
    for checkout in (root, *optional):
        if (checkout / "dodo_dsl").is_dir():
            found += [checkout, *(checkout / name for name in _OF_TESTS), checkout / ".git"]
    there = (Path(os.path.realpath(path)) for path in (*found, root / "tests_registry") if path.is_dir())
    return tuple(dict.fromkeys(there))


def _entries(folder: Path) -> Iterator[Path]:
    try:
        yield from folder.iterdir()
    except OSError:
        return
