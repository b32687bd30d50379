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
_USAGE, _STAT = "cpuacct.usage", "cpu.stat"
_UNUSED_S = 60.0
_TRIES, _TRY_S = 20, 0.01


class ProcessGroup:
    """A separate control group for at most ``limit`` processes and threads; use ``make``.

    It counts their processor time, too: in version 1 by ``account``, a group of another tree, where that can be made.
    """

    def __init__(self, folder: Path, limit: int, account: Path | None = None) -> None:
        (folder / "pids.max").write_text(f"{limit}\n")
        self._folders = [folder, *([account] if account else [])]
        self._members = [os.open(each / "cgroup.procs", os.O_WRONLY | os.O_CLOEXEC) for each in self._folders]
        self._usage = account / _USAGE if account else folder / _STAT

    def join(self) -> bool:
        """Between fork and exec: whether this process could enter, with all that it starts."""
        with contextlib.suppress(OSError):
            return all(os.write(members, b"0") > 0 for members in self._members)
        return False

    def used_s(self) -> float | None:
        """Processor time in s of all that were ever in it; None if it is not counted."""
        return _seconds(_text(self._usage))

    def remove(self) -> None:
        """When all of its processes have ended; the next run removes what is left."""
        for descriptor in self._members:
            os.close(descriptor)
        for folder in self._folders:
            _remove(folder)


def _remove(folder: Path) -> None:
    for _ in range(_TRIES):
        with contextlib.suppress(OSError):
            folder.rmdir()
            return
        time.sleep(_TRY_S)


def make(limit: int, proc: Path = Path("/proc/self")) -> ProcessGroup | None:
    """A group for this many processes of a service; None if this user may make none."""
    name = f"{_PREFIX}{secrets.token_hex(6)}"
    for parent in _parents(proc):
        folder = parent / name
        if not _made(folder):
            continue
        accounts = (each / name for each in _parents(proc, _CPUACCT) if (each / _USAGE).is_file())
        account = None if (folder / _STAT).is_file() else next((each for each in accounts if _made(each)), None)
        with contextlib.suppress(OSError):
            return ProcessGroup(folder, limit + OURS, account)
        for each in (folder, *([account] if account else [])):
            with contextlib.suppress(OSError):
                each.rmdir()
    return None


def _made(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        folder.mkdir()
        return True
    return False


def remove_unused(proc: Path = Path("/proc/self")) -> None:
    """Removes the groups of runs that were killed: they are empty, and were not made just now."""
    for parent in {*_parents(proc), *_parents(proc, _CPUACCT)}:
        for folder in parent.glob(f"{_PREFIX}*"):
            with contextlib.suppress(OSError):
                if time.time() - folder.stat().st_mtime > _UNUSED_S:
                    folder.rmdir()


def _text(file: Path) -> str:
    with contextlib.suppress(OSError):
        return file.read_text()
    return ""


def _seconds(text: str) -> float | None:
    """By the text of ``cpuacct.usage`` or ``cpu.stat``."""
    if text.strip().isdecimal():
        return int(text) / 1e9
    rows = dict(line.split() for line in text.splitlines())
    return int(rows["usage_usec"]) / 1e6 if "usage_usec" in rows else None


def _parents(proc: Path, counter: str = _PIDS) -> Iterator[Path]:
    """The groups in which others that count processes may be made: this process's own, or the one above it."""
    for own, top, is_first_version in _shown_groups(proc, counter):
        above = [own.parent] if own != top else []
        yield from [own] if is_first_version else (group for group in (own, *above) if _hands_on(group))


def _shown_groups(proc: Path, counter: str) -> Iterator[tuple[Path, Path, bool]]:
    """The group of a process, the top of the tree of which it is seen, and whether that is of version 1."""
    try:
        groups = [line.split(":", 2) for line in (proc / "cgroup").read_text().splitlines()]
        mounts = [line.split() for line in (proc / "mountinfo").read_text(errors="surrogateescape").splitlines()]
    except OSError:
        return
    for _, controllers, path in (group for group in groups if len(group) == 3):
        for mount in mounts:
            root, top, kind, options = mount[3], Path(mount[4]), mount[mount.index("-") + 1], mount[-1].split(",")
            is_first = kind == "cgroup" and counter in controllers.split(",") and counter in options
            if (is_first or (kind == "cgroup2" and not controllers)) and Path(path).is_relative_to(root):
                yield top / Path(path).relative_to(root), top, is_first


def _hands_on(group: Path) -> bool:
    """Whether groups in a group of version 2 can count processes."""
    with contextlib.suppress(OSError):
        return _PIDS in (group / "cgroup.subtree_control").read_text().split()
    return False
