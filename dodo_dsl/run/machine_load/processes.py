"""Processes by ``/proc``: which descend from which, their processor time, and their memory.

Memory is measured without cgroups, which not every machine has. Programs and files that are only read do not count.
"""

import contextlib
import os
import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

PROC = Path("/proc")
_STATE, _PARENT, _SESSION, _TIMES, _START = 0, 1, 3, slice(11, 15), 19
"""Fields of ``/proc/PID/stat`` (proc_pid_stat(5)) behind the program's name; times are those of it and its children."""
_ANONYMOUS = re.compile(rb"^(?:RssAnon|Pss_Anon):\s*(\d+)", re.MULTILINE)
_SHARED = re.compile(rb"^(?:RssShmem|Pss_Shmem):\s*(\d+)", re.MULTILINE)
"""Rows of ``/proc/PID/status``, and of ``smaps_rollup``, where what processes share counts in parts."""
_SMALL = 4 << 20
"""Bytes up to which it does not matter how much of their memory processes share."""
_MEMFD = "/memfd:"
_BLOCK = 512


class Process(NamedTuple):
    """``ticks`` on processors are also those of the children that it waited for.

    ``start`` in ticks since the machine started distinguishes it from a later one with its number.
    """

    parent: int
    session: int
    start: int
    ticks: int
    is_zombie: bool


def table(proc: Path = PROC) -> dict[int, Process]:
    found = {}
    for pid in (int(entry.name) for entry in proc.iterdir() if entry.name.isdigit()):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            words = (proc / str(pid) / "stat").read_bytes().rpartition(b")")[2].split()
            parent, session, start = (int(words[place]) for place in (_PARENT, _SESSION, _START))
            found[pid] = Process(parent, session, start, sum(map(int, words[_TIMES])), words[_STATE] == b"Z")
    return found


def living(proc: Path = PROC) -> dict[int, Process]:
    return {pid: process for pid, process in table(proc).items() if not process.is_zombie}


def owners(services: Mapping[int, str], known: Mapping[int, Process]) -> dict[int, str]:
    """The processes of ``services``, which are pids and names, and what they started, with the name.

    A name ``''`` is for what descends from a process and belongs to no other service, also not by its session.
    """
    found = {}
    for pid, process in known.items():
        ancestor = pid
        while ancestor in known and ancestor not in services:
            ancestor = known[ancestor].parent
        if (name := services.get(ancestor)) is not None:
            found[pid] = name or services.get(process.session, "")
    return found


def above(limits: Mapping[str, int], services: Mapping[int, str], proc: Path = PROC) -> dict[str, int]:
    """Bytes of memory of the services that use more than their limits, by name; see ``owners``."""
    memories, owned = segments(proc), owners(services, living(proc))
    sizes = {name: memory([pid for pid in owned if owned[pid] == name], memories, proc) for name in limits}
    return {name: size for name, size in sizes.items() if size > limits[name]}


def memory(pids: Collection[int], segments: Collection["Segment"], proc: Path = PROC) -> int:
    """Bytes that processes use together. What they share counts once, if this user may know it.

    Of shared memory the larger counts: what is mapped, or what only descriptors and attached System V memories hold.
    """
    sizes = [_sizes(f"{proc}/{pid}/status") or (0, 0) for pid in pids]
    if sum(map(sum, sizes)) - max(map(sum, sizes), default=0) > _SMALL:
        sizes = [_sizes(f"{proc}/{pid}/smaps_rollup") or size for pid, size in zip(pids, sizes, strict=True)]
    anonymous, shared = (sum(size[part] for size in sizes) for part in (0, 1))
    attached, detached = (
        sum(each.size for each in segments if each.is_attached == kind and _is_of(each, pids, proc))
        for kind in (True, False)
    )
    return anonymous + max(shared, _held(pids, proc) + attached) + detached


def _sizes(path: str) -> tuple[int, int] | None:
    """Bytes of anonymous and of shared memory, 0 of a process that has ended; None if this user may not read them."""
    try:
        text = Path(path).read_bytes()
    except PermissionError:
        return None
    except OSError:
        return 0, 0
    anonymous, shared = (sum(map(int, rows.findall(text))) * 1024 for rows in (_ANONYMOUS, _SHARED))
    return anonymous, shared


def _held(pids: Iterable[int], proc: Path) -> int:
    """Bytes of the files in memory of which these processes have descriptors, each once."""
    sizes: dict[tuple[int, int], int] = {}
    for pid in pids:
        with contextlib.suppress(OSError):  # it has ended meanwhile
            for entry in (proc / str(pid) / "fd").iterdir():
                with contextlib.suppress(OSError):
                    if str(entry.readlink()).startswith(_MEMFD):
                        about = entry.stat()
                        sizes[about.st_dev, about.st_ino] = about.st_blocks * _BLOCK
    return sum(sizes.values())


class Segment(NamedTuple):
    """A System V memory; ``creator`` is the process that made it, 0 for one of another namespace."""

    creator: int
    size: int
    is_attached: bool


def segments(proc: Path = PROC) -> list[Segment]:
    """The System V memories of this process's IPC namespace, with bytes in memory and swap (proc_pid_sysvipc(5))."""
    with contextlib.suppress(OSError):
        names, *rows = map(str.split, (proc / "sysvipc" / "shm").read_text().splitlines())
        creator, attached, resident, swapped = (names.index(name) for name in ("cpid", "nattch", "rss", "swap"))
        return [Segment(int(r[creator]), int(r[resident]) + int(r[swapped]), int(r[attached]) > 0) for r in rows]
    return []


def _is_of(segment: Segment, pids: Collection[int], proc: Path) -> bool:
    """Whether a System V memory is of the service that has these processes, one of which created it.

    Where the creator has ended, it is of every service, if this process is the first of its namespaces: elsewhere it
    may be of anybody.
    """
    creator = segment.creator
    return creator in pids or (creator > 0 and os.getpid() == 1 and not (proc / str(creator)).exists())
