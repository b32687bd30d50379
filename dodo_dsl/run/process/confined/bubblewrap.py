"""The words that start a program in a sandbox of its own by bubblewrap (bwrap(1)): pure text."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dodo_dsl.run.process.confined.confinement import Confinement

PROGRAM = "bwrap"
HOME = "/home/application"
_SYSTEM = ("/usr", "/etc", "/opt", "/sys/devices/system")
_MERGED = ("/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32")
"""On Debian since 12 these are links into /usr."""
_KEPT = ("CAP_SETUID", "CAP_SETGID", "CAP_SETPCAP")
"""What ``setpriv`` needs to give up root and then itself gives up."""

_TO_UNMASK = ("CAP_SYS_ADMIN", "CAP_MKNOD", "CAP_DAC_READ_SEARCH", "CAP_SYS_MODULE", "CAP_SYS_RAWIO")


@dataclass(frozen=True)
class Mounts:
    """Where the sandbox prepared the application's folder and home, ``/tmp`` and ``/dev/shm``, and what it may read."""

    folder: Path
    writable: bool
    """The folder; what is written there goes with the test."""
    home: Path
    shared: Mapping[str, Path]
    reads: Mapping[str, Path] = field(default_factory=dict)
    """By their paths; what is not there is shown as it is."""


def words(confined: Confinement, mounts: Mounts | None, program: str, user: int | None, filter_fd: int) -> list[str]:
    """The words before the application's own; ``mounts`` is None on the host, ``user`` None without root.

    ``program`` is the path of the application's program, which is shown where nothing else would.
    """
    always = [PROGRAM, "--unshare-pid", "--die-with-parent"]
    chdir = ["--chdir", confined.folder]
    if mounts is None:
        return [*always, "--dev-bind", "/", "/", *_masked(confined.masked), "--proc", "/proc", *chdir, "--"]
    seen = _seen(confined, mounts, program)
    filtered = ["--seccomp", str(filter_fd)]
    unshared = ["--unshare-uts", "--hostname", "application", "--unshare-cgroup-try"]
    if user is None:
        return [*always, *unshared, *seen, *chdir, "--cap-drop", "ALL", *filtered, "--"]
    kept = [word for name in _KEPT for word in ("--cap-add", name)]
    return [*always, *unshared, *seen, *chdir, "--cap-drop", "ALL", *kept, *filtered, "--", *_as_user(user)]


def _masked(devices: Iterable[str]) -> list[str]:
    """Nothing in the place of devices; root then has no capability to look behind, or to make the device anew."""
    binds = [word for path in devices for word in ("--dev-bind", "/dev/null", path)]
    return [*binds, *(word for name in _TO_UNMASK for word in ("--cap-drop", name))] if binds else []


def _as_user(user: int) -> list[str]:
    ids = [f"--reuid={user}", f"--regid={user}", "--clear-groups"]
    return ["setpriv", *ids, "--inh-caps=-all", "--ambient-caps=-all", "--bounding-set=-all", "--"]


def _seen(confined: Confinement, mounts: Mounts, program: str) -> list[str]:
    """The file system: the system's programs, what may be read, and the application's folder; all else is absent."""
    seen = [word for path in _SYSTEM for word in ("--ro-bind-try", path, path)]
    for path in _MERGED:
        if Path(path).is_symlink():
            seen += ["--symlink", str(Path(path).readlink()), path]
        else:
            seen += ["--ro-bind-try", path, path]
    seen += ["--proc", "/proc", "--dev", "/dev"]
    seen += [word for path, source in mounts.shared.items() for word in ("--bind", str(source), path)]
    seen += ["--tmpfs", "/run", "--tmpfs", "/var/tmp"]
    read = (*_shown(confined, program), *confined.reads)
    seen += [*_folders(_parents((HOME, confined.folder, *read))), *_read_only(read, mounts)]
    seen += ["--bind" if mounts.writable else "--ro-bind", str(mounts.folder), confined.folder]
    seen += ["--bind", str(mounts.home), HOME]
    for path in _outermost(filter(os.path.isdir, confined.hidden)):
        inside = [one for one in read if Path(one).is_relative_to(path)]
        parents = [one for one in _parents(inside) if Path(one).is_relative_to(path) and one != path]
        seen += ["--tmpfs", path, *_folders(parents), *_read_only(inside, mounts), "--remount-ro", path]
    return [*seen, "--remount-ro", "/"]


def _folders(paths: Iterable[str]) -> list[str]:
    return [word for path in paths for word in ("--perms", "0755", "--dir", path)]


def _read_only(paths: Iterable[str], mounts: Mounts) -> list[str]:
    return [word for path in paths for word in ("--ro-bind-try", str(mounts.reads.get(path, path)), path)]


def _outermost(paths: Iterable[str]) -> list[str]:
    """Paths without those that lie in another one: nothing can be mounted in what is hidden already."""
    found: list[str] = []
    for path in sorted(set(paths)):  # what holds others comes before them
        if not any(Path(path).is_relative_to(other) for other in found):
            found.append(path)
    return found


def _parents(paths: Iterable[str]) -> list[str]:
    """The folders that hold paths, outer ones first: everybody may pass through, as bubblewrap would not allow."""
    return sorted({str(parent) for path in paths for parent in Path(path).parents if parent != parent.parent})


def _shown(confined: Confinement, program: str) -> Sequence[str]:
    """The program's own file, where it lies in nothing that is shown."""
    shown = [Path(path) for path in (*_SYSTEM, *_MERGED, *confined.reads, confined.folder)]
    paths = dict.fromkeys((program, os.path.realpath(program)))
    return [path for path in paths if not any(Path(path).is_relative_to(folder) for folder in shown)]
