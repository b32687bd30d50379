"""Limits of the machine and of its users that a test shares with others: which of them are used up, and by whom.

An application that meets one of them is not to blame where others alone have used it up; where that cannot be known, it
is. Limits that a test has for itself, by namespaces, control groups or its own user id, are not among these.
"""

import contextlib
import os
import resource
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.run.machine_load.processes import table
from dodo_dsl.run.process import places, process_group

_FEW = 4
"""A limit with so few left is used up: what asked for more at once is gone already."""
_INOTIFY = "anon_inode:inotify"


@dataclass(frozen=True)
class Shortage:
    """A sentence on a limit that is used up, empty if there is none; and whether it is without the application."""

    text: str = ""
    is_of_others: bool = False


def used_up(application: Collection[int] | None, proc: Path = Path("/proc")) -> Shortage:
    """A limit that is used up, first one that is without the application. Takes some tens of milliseconds.

    The application's are processes ``application`` and what they started; None if they are not known.
    """
    others = set() if application is None else _others(application, proc)
    found = [each for each in (*_of_processes(proc, others), *_of_users(proc, others)) if each.text]
    return next((each for each in found if each.is_of_others), (*found, Shortage())[0])


def memory_kills(proc: Path = Path("/proc")) -> int:
    """How many processes the kernel has ended for want of memory since the machine started."""
    words = _words(proc / "vmstat")
    return int(words[words.index("oom_kill") + 1]) if "oom_kill" in words else 0


def _others(application: Collection[int], proc: Path) -> set[int]:
    """The processes of which all ancestors are known, and none is the application's.

    Counted are others and not the application, which may end meanwhile and leave what it used to nobody.
    """
    known, found = table(proc), set()
    for pid in known:
        line = [pid]
        while (process := known.get(line[-1])) and process.parent not in line:
            line.append(process.parent)
        if line[-1] == 0 and not {*line} & {*application}:
            found.add(pid)
    return found


def _of_processes(proc: Path, others: Collection[int]) -> Iterator[Shortage]:
    threads = {pid: number for pid, _, number in _counted(proc, _threads)}
    most = [number for name in ("pid_max", "threads-max") if (number := _number(proc / "sys/kernel" / name))]
    by_others = sum(number for pid, number in threads.items() if pid in others)
    yield _full("process numbers of this machine", _number(proc / "loadavg", 3), min(most, default=0), by_others)
    for group in process_group.holding(proc / "self"):
        members = {int(word) for folder in (group, *group.glob("**/")) for word in _words(folder / "cgroup.procs")}
        by_others = sum(number for pid, number in threads.items() if pid in members.intersection(others))
        used, limit = _number(group / "pids.current"), _number(group / "pids.max")
        yield _full(f"processes of the control group {group}", used, limit, by_others)


def _of_users(proc: Path, others: Collection[int]) -> Iterator[Shortage]:
    """What the kernel counts by user, but for users of a test's own."""
    inotify = proc / "sys/fs/inotify"
    for what, count, limit in (
        ("inotify instances", _instances, _number(inotify / "max_user_instances")),
        ("inotify watches", _watches, _number(inotify / "max_user_watches")),
        ("processes", _threads, resource.getrlimit(resource.RLIMIT_NPROC)[1] if os.getuid() else 0),
    ):
        used, by_others = Counter[int](), Counter[int]()
        for pid, user, number in _counted(proc, count):
            used[user] += number
            by_others[user] += number * (pid in others)
        for user in (os.getuid(),) if count is _threads else [user for user, _ in used.most_common(1)]:
            if not places.is_own(user):
                yield _full(f"{what} of user {user}", used[user], limit, by_others[user])


def _counted(proc: Path, count: Callable[[Path], int]) -> Iterator[tuple[int, int, int]]:
    """Number and user of the processes that use some, and how many."""
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended meanwhile, or is not ours to see
                if number := count(entry):
                    yield int(entry.name), entry.stat().st_uid, number


def _full(what: str, used: int, most: int, by_others: int) -> Shortage:
    if most <= 0 or used < most - _FEW:
        return Shortage()
    return Shortage(f"{used:,} of {most:,} {what} were in use", by_others >= max(most - _FEW, 1))


def _words(path: Path) -> list[str]:
    with contextlib.suppress(OSError):
        return path.read_text(errors="replace").split()
    return []


def _number(path: Path, place: int = 0) -> int:
    """A number among the words of a file, the second of a pair with a slash; 0 if there is none."""
    word = [*_words(path), *[""] * (place + 1)][place].rpartition("/")[2]
    return int(word) if word.isdecimal() else 0


def _threads(process: Path) -> int:
    return sum(1 for _ in (process / "task").iterdir())


def _instances(process: Path) -> int:
    return sum(1 for _ in _inotify(process))


def _watches(process: Path) -> int:
    return sum(_words(path).count("inotify") for path in _inotify(process))


def _inotify(process: Path) -> Iterator[Path]:
    for each in (process / "fd").iterdir():
        with contextlib.suppress(OSError):  # it was closed meanwhile
            if str(each.readlink()) == _INOTIFY:
                yield process / "fdinfo" / each.name
