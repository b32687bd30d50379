"""Limits of the machine and of its users that a test shares with others: which of them are used up, and by whom.

An application that meets one of them is not to blame. Limits that a test has for itself, by namespaces, control groups
or a user id of its own, are not among these.
"""

import contextlib
import functools
import os
import resource
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.run.process.confined import process_group, users
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_FEW = 4
"""A limit with so few left is used up: what asked for more at once is gone already."""
_FULL_BYTES = 1 << 16
_INOTIFY = "anon_inode:inotify"
_OF_THE_SHELL = (
    (resource.RLIMIT_NOFILE, "open files (ulimit -Hn)", "files"),
    (resource.RLIMIT_FSIZE, "bytes in a file (ulimit -Hf)", "file_size"),
    (resource.RLIMIT_DATA, "bytes of data (ulimit -Hd)", "memory"),
    (resource.RLIMIT_AS, "bytes of memory (ulimit -Hv)", "memory"),
)
_Count = Callable[[Path], int]
"""Of a folder of a process in /proc."""


@dataclass(frozen=True)
class Shared:
    """What of the machine a test shares: with ``host`` also ``/tmp``, shared memory and IPC.

    With ``engine`` a Docker engine runs the application, else it inherits the limits of this process.
    """

    host: bool
    engine: bool


def used_up(shared: Shared, root: Path = Path("/")) -> str:
    """A sentence on the first limit that is used up; empty where there is none. Takes some tens of milliseconds."""
    proc, system = root / "proc", root / "proc/sys"
    found: Iterator[str] = (text for part in (_of_machine(proc, system), _of_users(proc, system)) for text in part)
    text = next((text for text in found if text), "")
    return text or next((text for text in _of_place(shared, root, proc, system) if text), "")


def below(limits: SandboxLimits) -> str:
    """A sentence on a limit of this process that is below what the test allows a program; empty where there is none."""
    for kind, what, name in _OF_THE_SHELL:
        _, hard = resource.getrlimit(kind)
        if hard != resource.RLIM_INFINITY and hard < (wanted := getattr(limits, name)):
            return f"DoDo was started with at most {hard:,} {what}, the test allows {wanted:,}"
    return ""


def memory_kills(proc: Path = Path("/proc")) -> int:
    """How many processes the kernel has ended for want of memory since the machine started."""
    rows = (line.split() for line in _lines(proc / "vmstat"))
    return next((int(row[1]) for row in rows if row[0] == "oom_kill"), 0)


def _of_machine(proc: Path, system: Path) -> Iterator[str]:
    threads = _number(proc / "loadavg", 3)
    numbers = [most for name in ("pid_max", "threads-max") if (most := _number(system / "kernel" / name))]
    yield _full("process numbers of this machine", threads, min(numbers, default=0), lambda: _most(proc, _threads))
    files = system / "fs/file-nr"
    yield _full("open files of this machine", _number(files), _number(files, 2), lambda: _most(proc, _files))
    yield _full("asynchronous requests (aio)", _number(system / "fs/aio-nr"), _number(system / "fs/aio-max-nr"))
    rows = (line.split() for line in _lines(proc / "net/sockstat"))
    pages = next((int(row[-1]) for row in rows if row[:1] == ["UDP:"]), 0)
    yield _full("pages of memory for UDP (udp_mem)", pages, _number(system / "net/ipv4/udp_mem", 2))
    if _number(system / "vm/overcommit_memory") == 2:
        sizes = {line.partition(":")[0]: line.split()[1] for line in _lines(proc / "meminfo")}
        used, most = (int(sizes.get(name, 0)) // 1024 for name in ("Committed_AS", "CommitLimit"))
        yield _full("MB of memory that programs may ask for (overcommit_memory)", used, most)
    for group in process_group.holding(proc / "self"):
        used, most = _number(group / "pids.current"), _number(group / "pids.max")
        yield _full(f"processes of the control group {group}", used, most)


def _of_users(proc: Path, system: Path) -> Iterator[str]:
    """What the kernel counts by user, but for users of a test's own."""
    for name, count in (("instances", _instances), ("watches", _watches)):
        most = _number(system / f"fs/inotify/max_user_{name}")
        for user, used in _by_user(proc, count).most_common(1):
            if user not in range(users.FIRST, users.LAST + 1):
                yield _full(f"inotify {name} of user {user}", used, most, functools.partial(_most, proc, count))
    user, (_, hard) = os.getuid(), resource.getrlimit(resource.RLIMIT_NPROC)
    if user and hard != resource.RLIM_INFINITY:
        used = _by_user(proc, _threads)[user]
        yield _full(f"processes of user {user} (ulimit -Hu)", used, hard, lambda: _most(proc, _threads))


def _of_place(shared: Shared, root: Path, proc: Path, system: Path) -> Iterator[str]:
    if shared.engine:
        tracked = system / "net/netfilter"
        used, most = (_number(tracked / f"nf_conntrack_{name}") for name in ("count", "max"))
        yield _full("tracked connections (nf_conntrack_max)", used, most)
        yield _disk(root / "var/lib/docker")
    if shared.host:
        for kind, file, place in (("shm", "shmmni", 0), ("sem", "sem", 3), ("msg", "msgmni", 0)):
            used = len(_lines(proc / "sysvipc" / kind)) - 1
            yield _full(f"System V identifiers ({kind})", used, _number(system / "kernel" / file, place))
        yield _disk(root / "tmp")
        yield _disk(root / "dev/shm")


def _full(what: str, used: int, most: int, by: Callable[[], str] = lambda: "") -> str:
    return f"{used:,} of {most:,} {what} were in use{by()}" if most and used >= most - _FEW else ""


def _disk(folder: Path) -> str:
    with contextlib.suppress(OSError):
        found = os.statvfs(folder)
        if found.f_blocks and found.f_bavail * found.f_frsize < _FULL_BYTES:
            return f"the file system of {folder} was full"
        if found.f_files and not found.f_favail:
            return f"the file system of {folder} had no inode left"
    return ""


def _lines(path: Path) -> list[str]:
    with contextlib.suppress(OSError):
        return path.read_text(errors="replace").splitlines()
    return []


def _number(path: Path, place: int = 0) -> int:
    """A number among the words of a file, the second of a pair with a slash; 0 where there is none."""
    words = " ".join(_lines(path)).split()
    word = words[place].rpartition("/")[2] if place < len(words) else ""
    return int(word) if word.isdecimal() else 0


def _by_user(proc: Path, count: _Count) -> "Counter[int]":
    found: Counter[int] = Counter()
    for user, _, number in _counted(proc, count):
        found[user] += number
    return found


def _most(proc: Path, count: _Count) -> str:
    """The program that uses most, for a sentence."""
    names: Counter[str] = Counter()
    for _, name, number in _counted(proc, count):
        names[name] += number
    return "".join(f", {number:,} of them by '{name}'" for name, number in names.most_common(1))


def _counted(proc: Path, count: _Count) -> Iterator[tuple[int, str, int]]:
    """User and name of the processes that use some, and how many."""
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended meanwhile, or is not ours to see
                if number := count(entry):
                    yield entry.stat().st_uid, (entry / "comm").read_text(errors="replace").strip(), number


def _threads(process: Path) -> int:
    return sum(1 for _ in (process / "task").iterdir())


def _files(process: Path) -> int:
    return sum(1 for _ in (process / "fd").iterdir())


def _instances(process: Path) -> int:
    return len(_inotify(process))


def _watches(process: Path) -> int:
    return sum(line.startswith("inotify wd:") for path in _inotify(process) for line in _lines(path))


def _inotify(process: Path) -> list[Path]:
    found = [each.name for each in (process / "fd").iterdir() if str(each.readlink()) == _INOTIFY]
    return [process / "fdinfo" / name for name in found]
