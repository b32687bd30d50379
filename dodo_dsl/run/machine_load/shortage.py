"""Limits of the machine and of its users that a test shares with others: which of them are used up, and by whom.

An application that meets one of them is not to blame where others alone have used it up; where that cannot be known, it
is. Limits that a test has for itself, by namespaces, control groups or its own user id, are not among these.
"""

import contextlib
import os
import resource
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dodo_dsl.run.process import places, process_group
from dodo_dsl.spec.sandbox_limits import SandboxLimits

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


@dataclass(frozen=True)
class Shortage:
    """A sentence on a limit that is used up, empty if there is none; and whether it is without the application."""

    text: str = ""
    is_of_others: bool = False


def used_up(shared: Shared, application: Collection[int] | None, root: Path = Path("/")) -> Shortage:
    """A limit that is used up, first one that is without the application. Takes some tens of milliseconds.

    The application's are processes ``application`` and what they started; None if they are not known.
    """
    table = _Processes(root / "proc", application)
    found = [*_of_machine(table), *_of_users(table), *_of_place(shared, root, table)]
    of_others = (each for each in found if each.is_of_others)
    return next(of_others, next((each for each in found if each.text), Shortage()))


def below(limits: SandboxLimits) -> str:
    """A sentence on a limit of this process that is below what the test allows a program; empty if there is none."""
    for kind, what, name in _OF_THE_SHELL:
        _, hard = resource.getrlimit(kind)
        if hard != resource.RLIM_INFINITY and hard < (wanted := getattr(limits, name)):
            return f"DoDo was started with at most {hard:,} {what}, the test allows {wanted:,}"
    return ""


def memory_kills(proc: Path = Path("/proc")) -> int:
    """How many processes the kernel has ended for want of memory since the machine started."""
    rows = (line.split() for line in _lines(proc / "vmstat"))
    return next((int(row[1]) for row in rows if row[0] == "oom_kill"), 0)


class _Processes:
    """The processes that ``proc`` shows, with those of the application and their descendants, if they are known."""

    def __init__(self, proc: Path, application: Collection[int] | None) -> None:
        self.proc = proc
        self._application = application

    def by_user(self, count: _Count) -> "Counter[int]":
        found: Counter[int] = Counter()
        for _, user, _, number in self._counted(count):
            found[user] += number
        return found

    def most(self, count: _Count) -> str:
        """The program that uses most, for a sentence."""
        names: Counter[str] = Counter()
        for _, _, name, number in self._counted(count):
            names[name] += number
        return "".join(f", {number:,} of them by '{name}'" for name, number in names.most_common(1))

    def of_others(self, count: _Count, user: int | None = None, among: Collection[int] | None = None) -> int:
        """What others than the application use at least, by a user and among some processes; 0 if it is not known.

        Counted are others and not the application, which may end meanwhile and leave what it used to nobody.
        """
        if self._application is None:
            return 0
        found = list(self._counted(count))
        parents = self._parents()
        return sum(
            number
            for pid, owner, _, number in found
            if user in (None, owner) and (among is None or pid in among) and self._is_of_others(pid, parents)
        )

    def _is_of_others(self, pid: int, parents: Mapping[int, int]) -> bool:
        """Whether the line of its parents is known, and none of them is the application's."""
        line = []
        while pid and pid in parents and pid not in line:
            line.append(pid)
            pid = parents[pid]
        return pid == 0 and not {*line} & {*(self._application or ())}

    def _parents(self) -> dict[int, int]:
        found = {}
        for entry in self.proc.iterdir():
            if entry.name.isdigit():
                with contextlib.suppress(OSError, IndexError, ValueError):  # it has ended meanwhile
                    words = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                    found[int(entry.name)] = int(words[1])
        return found

    def _counted(self, count: _Count) -> Iterator[tuple[int, int, str, int]]:
        """Number, user and name of the processes that use some, and how many."""
        for entry in self.proc.iterdir():
            if entry.name.isdigit():
                with contextlib.suppress(OSError):  # it has ended meanwhile, or is not ours to see
                    if number := count(entry):
                        name = (entry / "comm").read_text(errors="replace").strip()
                        yield int(entry.name), entry.stat().st_uid, name, number


def _of_machine(table: _Processes) -> Iterator[Shortage]:
    proc, system = table.proc, table.proc / "sys"
    threads = _number(proc / "loadavg", 3)
    numbers = [most for name in ("pid_max", "threads-max") if (most := _number(system / "kernel" / name))]
    by, others = partial(table.most, _threads), partial(table.of_others, _threads)
    yield _full("process numbers of this machine", threads, min(numbers, default=0), by, others)
    files = system / "fs/file-nr"
    yield _full("open files of this machine", _number(files), _number(files, 2), partial(table.most, _files))
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
        others = partial(_others_in, table, group)
        yield _full(f"processes of the control group {group}", used, most, others=others)


def _others_in(table: _Processes, group: Path) -> int:
    """Processes and threads of others in a control group and those below it."""
    lists = (_lines(folder / "cgroup.procs") for folder in (group, *group.glob("**/")))
    return table.of_others(_threads, among={int(line) for lines in lists for line in lines if line.isdecimal()})


def _of_users(table: _Processes) -> Iterator[Shortage]:
    """What the kernel counts by user, but for users of a test's own."""
    for name, count in (("instances", _instances), ("watches", _watches)):
        most = _number(table.proc / f"sys/fs/inotify/max_user_{name}")
        for user, used in table.by_user(count).most_common(1):
            if not places.is_own(user):
                by, others = partial(table.most, count), partial(table.of_others, count, user)
                yield _full(f"inotify {name} of user {user}", used, most, by, others)
    user, (_, hard) = os.getuid(), resource.getrlimit(resource.RLIMIT_NPROC)
    if user and hard != resource.RLIM_INFINITY:
        used = table.by_user(_threads)[user]
        by, others = partial(table.most, _threads), partial(table.of_others, _threads, user)
        yield _full(f"processes of user {user} (ulimit -Hu)", used, hard, by, others)


def _of_place(shared: Shared, root: Path, table: _Processes) -> Iterator[Shortage]:
    """What has no owner, so that the application may have used it up."""
    proc, system = table.proc, table.proc / "sys"
    if shared.engine:
        tracked = system / "net/netfilter"
        used, most = (_number(tracked / f"nf_conntrack_{name}") for name in ("count", "max"))
        yield _full("tracked connections (nf_conntrack_max)", used, most)
        yield Shortage(_disk(root / "var/lib/docker"))
    if shared.host:
        for kind, file, place in (("shm", "shmmni", 0), ("sem", "sem", 3), ("msg", "msgmni", 0)):
            used = len(_lines(proc / "sysvipc" / kind)) - 1
            yield _full(f"System V identifiers ({kind})", used, _number(system / "kernel" / file, place))
        yield Shortage(_disk(root / "tmp"))
        yield Shortage(_disk(root / "dev/shm"))


def _full(
    what: str, used: int, most: int, by: Callable[[], str] = lambda: "", others: Callable[[], int] = lambda: 0
) -> Shortage:
    """``others`` is what others than the application use, 0 if it cannot be known."""
    if not most or used < most - _FEW:
        return Shortage()
    return Shortage(f"{used:,} of {most:,} {what} were in use{by()}", others() >= max(most - _FEW, 1))


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
    """A number among the words of a file, the second of a pair with a slash; 0 if there is none."""
    words = " ".join(_lines(path)).split()
    word = words[place].rpartition("/")[2] if place < len(words) else ""
    return int(word) if word.isdecimal() else 0


def _threads(process: Path) -> int:
    return sum(1 for _ in (process / "task").iterdir())


def _files(process: Path) -> int:
    return sum(1 for _ in (process / "fd").iterdir())


def _instances(process: Path) -> int:
    return len(_inotify(process))


def _watches(process: Path) -> int:
    return sum(line.startswith("inotify wd:") for path in _inotify(process) for line in _lines(path))


def _inotify(process: Path) -> list[Path]:
    found = []
    for each in (process / "fd").iterdir():
        with contextlib.suppress(OSError):  # it was closed meanwhile
            if str(each.readlink()) == _INOTIFY:
                found.append(process / "fdinfo" / each.name)
    return found
