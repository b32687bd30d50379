"""What a service of the application sees and may use, and the words by which bubblewrap (bwrap(1)) confines it.

Bubblewrap reads them from a file without a name: everybody on the machine can read words of a command line, and the
application's variables are among them. Of these, LD_PRELOAD and such act on the application's program alone, as it is
what bubblewrap executes next.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.run.process.places import Places
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_PACKAGE = Path(__file__).resolve().parents[2]
INTERPRETER = tuple(dict.fromkeys((sys.prefix, sys.base_prefix)))
"""The folders of this Python, which may run the application's programs."""
SYSTEM = ("/usr", "/etc", "/opt", "/sys/devices/system")
"""What every application sees of the machine."""


@dataclass(frozen=True)
class Confinement:
    """``folder`` is the application's own, ``reads`` is what else it may read, ``hidden`` lies in them and stays out.

    On the host it has only its own processes, and sees what DoDo sees but for devices that are masked.
    """

    folder: str
    reads: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    channels: str = ""
    """On the host: where services of all tests meet, which it must not see."""
    time: str = ""
    """The folder by which it gets the test's time, where it may write into the page and wake its threads."""


@dataclass(frozen=True)
class Command:
    """A process to start; an application's is ``confined`` where this machine can do that."""

    name: str
    layer: str
    argv: tuple[str, ...]
    environment: Mapping[str, str]
    folder: str
    is_module: bool = False
    """Whether it is one of DoDo's own Python modules, which may be forked from a process with their libraries."""
    masked: tuple[str, ...] = ()
    """Device files that it must not see: the ports of rigs that it does not move."""
    confined: Confinement | None = None


def readable(folder: Path, limits: SandboxLimits, *more: Path) -> tuple[str, ...]:
    """What an application may read beside its ``folder``."""
    allowed = ((folder / Path(path).expanduser()).resolve() for path in limits.reads)
    return tuple(dict.fromkeys(map(str, (*INTERPRETER, _PACKAGE, *allowed, *more))))


def _inside(hidden: Iterable[str], shown: Iterable[str]) -> Iterator[str]:
    """The paths below those that are shown, by each of their names."""
    real = {Path(path): Path(os.path.realpath(path)) for path in shown}
    for path in map(Path, hidden):
        for name, place in real.items():
            if path != place and path.is_relative_to(place):
                yield str(name / path.relative_to(place))


PROGRAM = "bwrap"
HOME = "/home/application"
MERGED = ("/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32")
"""On Debian since 12 these are links into /usr."""
_EMPTY = ("/run", "/var/tmp")
"""Folders that programs may look into, and that nobody may write to."""
_TO_UNMASK = ("CAP_SYS_ADMIN", "CAP_MKNOD", "CAP_DAC_READ_SEARCH", "CAP_SYS_MODULE", "CAP_SYS_RAWIO")


def sandbox_words(
    confined: Confinement,
    places: Places | None,
    program: str,
    environment: Mapping[str, str],
    masked: Iterable[str] = (),
) -> list[str]:
    """What bubblewrap is to do, but for descriptors; ``places`` is None on the host, where devices are ``masked``.

    ``program`` is the path of the application's program, which is shown where nothing else would.
    """
    words = ["--unshare-pid", "--die-with-parent", "--clearenv"]
    words += [word for name, value in environment.items() for word in ("--setenv", name, value)]
    if places is None:
        words += ["--dev-bind", "/", "/", *_masked(masked, confined.channels), "--proc", "/proc"]
    else:
        words += ["--unshare-uts", "--hostname", "application", "--unshare-cgroup-try", "--cap-drop", "ALL"]
        words += _seen(confined, places, program)
    return [*words, "--chdir", confined.folder]


def as_data(words: Sequence[str]) -> bytes:
    """Words as bubblewrap reads them from a file; raises ValueError."""
    if any("\0" in word for word in words):
        raise ValueError("a word or a variable holds a NUL character")
    return b"".join(os.fsencode(f"{word}\0") for word in words)


def _masked(devices: Iterable[str], channels: str) -> list[str]:
    """Nothing in the place of devices and channels; root then has no capability to look behind, or to make them."""
    binds = [word for path in devices for word in ("--dev-bind", "/dev/null", path)]
    binds += ["--tmpfs", channels] if channels else []
    return [*binds, *(word for name in _TO_UNMASK for word in ("--cap-drop", name))] if binds else []


def _seen(confined: Confinement, places: Places, program: str) -> list[str]:
    """The file system: the system's programs, what may be read, and the application's folder; all else is absent.

    Within them lies what is hidden, and in that again what may be read: outer paths come first.
    """
    shown = {path: ["--ro-bind-try", path, path] for path in SYSTEM}
    for path in MERGED:
        is_link = Path(path).is_symlink()
        shown[path] = ["--symlink", str(Path(path).readlink()), path] if is_link else ["--ro-bind-try", path, path]
    reads = (*_programs(confined, program), *confined.reads)
    shown |= {path: ["--ro-bind-try", str(places.read(path)), path] for path in reads}
    own = {path: ["--bind", str(source), path] for path, source in {**places.shared, HOME: places.home}.items()}
    own[confined.folder] = ["--bind" if places.writable else "--ro-bind", str(places.folder), confined.folder]
    inside = _inside(confined.hidden, (*SYSTEM, *confined.reads, confined.folder))
    hidden = {*filter(os.path.exists, inside), *places.mounted} - {*reads, *own}
    words = ["--proc", "/proc", "--dev", "/dev", *(word for path in _EMPTY for word in ("--dir", path))]
    shows: dict[str, bool | None] = {"/": False}
    """Whether what is mounted at a path shows what lies there; None where that is another folder."""
    for path in sorted({*shown, *own, *hidden}, key=lambda path: Path(path).parts):
        outer = next(shows[outer] for outer in map(str, Path(path).parents) if outer in shows)
        if path in own:
            words += own[path]
            shows[path] = None if path in places.shared else True
        elif path in hidden and outer is not False:
            words += ["--tmpfs", path] if Path(path).is_dir() else ["--ro-bind", os.devnull, path]
            shows[path] = False
        elif path in shown and path not in hidden and outer is not True:
            words += shown[path]
            shows[path] = True
    empty = [path for path, is_shown in shows.items() if is_shown is False and Path(path).is_dir()]
    return [*words, *_time(confined.time), *(word for path in ("/dev", *empty) for word in ("--remount-ro", path))]


def _time(folder: str) -> list[str]:
    """No file there can be replaced, also where the application's user is DoDo's own; FIFOs can be written to."""
    if not folder:
        return []
    page = f"{folder}/page"
    channels = [word for name in ("command", "reply") for word in ("--ro-bind", os.devnull, f"{folder}/{name}")]
    return ["--ro-bind", folder, folder, "--bind", page, page, *channels]


def _programs(confined: Confinement, program: str) -> Sequence[str]:
    """The program's own file, where it lies in nothing that is shown."""
    shown = [Path(path) for path in (*SYSTEM, *MERGED, *confined.reads, confined.folder)]
    paths = dict.fromkeys((program, os.path.realpath(program)))
    return [path for path in paths if not any(Path(path).is_relative_to(folder) for folder in shown)]
