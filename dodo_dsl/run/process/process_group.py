"""Control groups that count the processes of a service (cgroups(7)), where there are some that this user may use."""

import contextlib
import os
import secrets
import time
from collections.abc import Iterator
from pathlib import Path

OURS = 2
"""Processes of a service's sandbox that are not the application's: bubblewrap, and the first of its namespace."""
_PREFIX = "dodo-"
_PIDS, _CPUACCT = "pids", "cpuacct"
_UNUSED_S = 60.0
_TRIES, _TRY_S = 20, 0.01


class ProcessGroup:
    """A separate control group for at most ``limit`` processes and threads; use ``make``.

    It counts their processor time, too: in version 1 by its last folder, one of another tree.
    """

    def __init__(self, folders: list[Path], limit: int) -> None:
        self._folders = folders
        (folders[0] / "pids.max").write_text(f"{limit}\n")
        self._members = [os.open(each / "cgroup.procs", os.O_WRONLY | os.O_CLOEXEC) for each in folders]

    def join(self) -> bool:
        """Between fork and exec: whether this process could enter, with all that it starts."""
        with contextlib.suppress(OSError):
            return all(os.write(members, b"0") > 0 for members in self._members)
        return False

    def used_s(self) -> float:
        """Processor time in s of all that were ever in it; 0 if it is not counted."""
        with contextlib.suppress(OSError):
            return int((self._folders[-1] / "cpuacct.usage").read_text()) / 1e9
        with contextlib.suppress(OSError, KeyError):
            rows = dict(line.split() for line in (self._folders[0] / "cpu.stat").read_text().splitlines())
            return int(rows["usage_usec"]) / 1e6
        return 0.0

    def remove(self) -> None:
        """When all of its processes have ended; the next run removes what is left."""
        for descriptor in self._members:
            os.close(descriptor)
        for folder in self._folders:
            for _ in range(_TRIES):
                with contextlib.suppress(OSError):
                    folder.rmdir()
                    break
                time.sleep(_TRY_S)


def make(limit: int) -> ProcessGroup | None:
    """A group for this many processes of a service; None if this user may make none."""
    name = f"{_PREFIX}{secrets.token_hex(6)}"
    counting = _made(_PIDS, name)
    if not counting:
        return None
    folders = [*counting, *_made(_CPUACCT, name)]
    try:
        return ProcessGroup(folders, limit + OURS)
    except OSError:
        for folder in folders:
            with contextlib.suppress(OSError):
                folder.rmdir()
        return None


def _made(counter: str, name: str) -> list[Path]:
    """The first group of this name that could be made."""
    for parent in parents(counter):
        with contextlib.suppress(OSError):
            (parent / name).mkdir()
            return [parent / name]
    return []


def remove_unused() -> None:
    """Removes the groups of runs that were killed: they are empty, and were not made just now."""
    for parent in {*parents(_PIDS), *parents(_CPUACCT)}:
        for folder in parent.glob(f"{_PREFIX}*"):
            with contextlib.suppress(OSError):
                if time.time() - folder.stat().st_mtime > _UNUSED_S:
                    folder.rmdir()


def parents(counter: str = _PIDS) -> Iterator[Path]:
    """The groups in which others that count may be made: this process's own, or in version 2 the one above it."""
    own_proc = Path("/proc/self")
    try:
        groups = [line.split(":", 2) for line in (own_proc / "cgroup").read_text().splitlines()]
        mounts = [line.split() for line in (own_proc / "mountinfo").read_text(errors="surrogateescape").splitlines()]
    except OSError:
        return
    for _, controllers, path in groups:
        for mount in mounts:
            root, top, kind, options = mount[3], Path(mount[4]), mount[mount.index("-") + 1], mount[-1].split(",")
            if not Path(path).is_relative_to(root):
                continue
            own = top / Path(path).relative_to(root)
            if kind == "cgroup" and counter in controllers.split(",") and counter in options:
                yield own
            elif kind == "cgroup2" and not controllers:
                yield from filter(_counts, (own, *([own.parent] if own != top else [])))


def _counts(group: Path) -> bool:
    """Whether groups in a group of version 2 can count processes."""
    with contextlib.suppress(OSError):
        return _PIDS in (group / "cgroup.subtree_control").read_text().split()
    return False
