"""The words that start a program in a sandbox of its own by bubblewrap (bwrap(1)): pure text."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
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
    """Where the sandbox prepared the application's folder, home and ``/tmp``."""

    folder: Path
    writable: bool
    """The folder; what is written there goes with the test."""
    home: Path
    tmp: Path


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
    seen += ["--proc", "/proc", "--dev", "/dev", "--bind", "/dev/shm", "/dev/shm", "--bind", str(mounts.tmp), "/tmp"]
    seen += ["--tmpfs", "/run", "--tmpfs", "/var/tmp"]
    read = (*_shown(confined, program), *confined.reads)
    for parent in _parents((HOME, confined.folder, *read)):
        seen += ["--perms", "0755", "--dir", parent]
    for path in read:
        seen += ["--ro-bind-try", path, path]
    seen += ["--bind" if mounts.writable else "--ro-bind", str(mounts.folder), confined.folder]
    seen += ["--bind", str(mounts.home), HOME]
    for path in confined.hidden:
        if Path(path).is_dir():
            seen += ["--tmpfs", path, "--remount-ro", path]
    return [*seen, "--remount-ro", "/"]


def _parents(paths: Iterable[str]) -> list[str]:
    """The folders that hold paths, outer ones first: everybody may pass through, as bubblewrap would not allow."""
    return sorted({str(parent) for path in paths for parent in Path(path).parents if parent != parent.parent})


def _shown(confined: Confinement, program: str) -> Sequence[str]:
    """The program's own file, where it lies in nothing that is shown."""
    shown = [Path(path) for path in (*_SYSTEM, *_MERGED, *confined.reads, confined.folder)]
    paths = dict.fromkeys((program, os.path.realpath(program)))
    return [path for path in paths if not any(Path(path).is_relative_to(folder) for folder in shown)]
