"""Limits on processes that a test shares with others of its machine: which of them are used up, and by whom.

An application that meets one of them is not to blame where others alone have used it up; where that cannot be known, it
is. Limits that a test has for itself, by namespaces, control groups or its own user id, are not among these.
"""

import contextlib
import os
import resource
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.run.machine_load.processes import PROC, table
from dodo_dsl.run.process import process_group

_FEW = 4
"""A limit with so few left is used up: what asked for more at once is gone already."""


@dataclass(frozen=True)
class Shortage:
    """A sentence on a limit that is used up, empty if there is none; and whether it is without the application."""

    text: str = ""
    is_of_others: bool = False


def used_up(application: Collection[int] | None, proc: Path = PROC) -> Shortage:
    """A limit that is used up, first one that is without the application.

    The application's are processes ``application`` and what they started; None if they are not known.
    """
    threads, found = dict(_threads(proc)), list[Shortage]()
    others = set() if application is None else _others(application, proc)
    for what, used, most, counted in _limits(threads, proc):
        if 0 < most <= used + _FEW:
            by_others = sum(threads[pid] for pid in others.intersection(counted, threads))
            found.append(Shortage(f"{used:,} of {most:,} {what} were in use", by_others >= max(most - _FEW, 1)))
    return next((each for each in found if each.is_of_others), (*found, Shortage())[0])


def memory_kills(proc: Path = PROC) -> int:
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


def _threads(proc: Path) -> Iterator[tuple[int, int]]:
    """The processes, and how many threads each has."""
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended meanwhile
                yield int(entry.name), sum(1 for _ in (entry / "task").iterdir())


def _limits(threads: Mapping[int, int], proc: Path) -> Iterator[tuple[str, int, int, Collection[int]]]:
    """What is counted, how many there are, how many are allowed, or 0, and the processes that count."""
    most = [number for name in ("pid_max", "threads-max") if (number := _number(proc / "sys/kernel" / name))]
    yield "process numbers of this machine", _number(proc / "loadavg", 3), min(most, default=0), threads
    for group in process_group.holding(proc / "self"):
        members = [int(word) for folder in (group, *group.glob("**/")) for word in _words(folder / "cgroup.procs")]
        limit = _number(group / "pids.max")
        yield f"processes of the control group {group}", _number(group / "pids.current"), limit, members
    if user := os.getuid():  # the kernel does not count those of root
        own = [pid for pid in threads if _is_of(user, proc / str(pid))]
        _, limit = resource.getrlimit(resource.RLIMIT_NPROC)
        yield f"processes of user {user}", sum(threads[pid] for pid in own), limit, own


def _is_of(user: int, process: Path) -> bool:
    with contextlib.suppress(OSError):
        return process.stat().st_uid == user
    return False


def _words(path: Path) -> list[str]:
    with contextlib.suppress(OSError):
        return path.read_text(errors="replace").split()
    return []


def _number(path: Path, place: int = 0) -> int:
    """A number among the words of a file, the second of a pair with a slash; 0 if there is none."""
    word = [*_words(path), *[""] * (place + 1)][place].rpartition("/")[2]
    return int(word) if word.isdecimal() else 0
