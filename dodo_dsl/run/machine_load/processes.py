"""Processes by ``/proc``: which descend from which, their memory, and their processor time and run delay by service.

Memory is measured without cgroups, which not every machine has. Programs and files that are only read do not count.
Files in memory that only a descriptor holds (memfd_create(2)), and System V memories that processes are attached to,
count as shared memory that is mapped does; the larger of both. System V memories to which no process is attached count
in addition. Time is by thread, added up by service.
"""

import contextlib
import os
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple


def parents(proc: Path = Path("/proc")) -> Iterator[tuple[int, int]]:
    """The pids of every process that is not a zombie and of its parent."""
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                if fields[0] != "Z":
                    yield int(entry.name), int(fields[1])


def owners(services: Mapping[int, str], proc: Path = Path("/proc")) -> Iterator[tuple[int, str]]:
    """The pids of the processes of ``services``, which are pids and names, and of what they started, with the name."""
    known = dict(parents(proc))
    for pid in known:
        ancestor = pid
        while ancestor in known and ancestor not in services:
            ancestor = known[ancestor]
        if ancestor in services:
            yield pid, services[ancestor]


PROC = Path("/proc")
_RESIDENT = (b"RssAnon:", b"RssShmem:")
_PROPORTIONAL = (b"Pss_Anon:", b"Pss_Shmem:")
_MEMFD = "/memfd:"
_BLOCK = 512


class SegmentUse(NamedTuple):
    """A System V memory; ``creator`` is the process that made it, 0 for one of another namespace."""

    creator: int
    size: int
    is_attached: bool


def resident(pid: int, proc: Path = PROC) -> tuple[int, int]:
    """Bytes of anonymous and of shared memory: quick to read, but what processes share counts in each of them."""
    return _rows(f"{proc}/{pid}/status", _RESIDENT)


def proportional(pid: int, proc: Path = PROC) -> tuple[int, int]:
    """The same with the process's part of what it shares (proc_pid_smaps(5)); the kernel looks at every page for it."""
    return _rows(f"{proc}/{pid}/smaps_rollup", _PROPORTIONAL)


def held(pids: Iterable[int], proc: Path = PROC) -> int:
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


def segments(proc: Path = PROC) -> list[SegmentUse]:
    """The System V memories of this process's IPC namespace, with bytes in memory and swap (proc_pid_sysvipc(5))."""
    with contextlib.suppress(OSError):
        with open(f"{proc}/sysvipc/shm", "rb", buffering=0) as file:  # noqa: PTH123
            names, *rows = [line.split() for line in file.readall().splitlines()]
        creator, attached, resident_, swapped = (names.index(name) for name in (b"cpid", b"nattch", b"rss", b"swap"))
        return [SegmentUse(int(r[creator]), int(r[resident_]) + int(r[swapped]), int(r[attached]) > 0) for r in rows]
    return []


def of_service(found: Iterable[SegmentUse], pids: Collection[int], proc: Path = PROC) -> tuple[int, int]:
    """Bytes of System V memories of a service: those with processes attached, and others.

    They are of the service whose process created them. Where the creator has ended, they are of every service, if this
    process is the first of its namespaces: elsewhere they may be of anybody.
    """
    attached = detached = 0
    for creator, size, is_attached in found:
        is_orphan = creator > 0 and os.getpid() == 1 and not os.path.exists(f"{proc}/{creator}")  # noqa: PTH110
        if creator in pids or is_orphan:
            attached, detached = attached + size * is_attached, detached + size * (not is_attached)
    return attached, detached


def _rows(path: str, rows: tuple[bytes, bytes]) -> tuple[int, int]:
    """Two rows of a file, in bytes; nothing of a process that has ended. It is read many times a second."""
    try:
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123
            text = file.read()
    except OSError:
        return 0, 0
    first, second = (_kilobytes(text, row) * 1024 for row in rows)
    return first, second


def _kilobytes(text: bytes, row: bytes) -> int:
    at = text.find(b"\n" + row)
    return int(text[at + 1 + len(row) :].split(None, 1)[0]) if at >= 0 else 0


_PARENT, _SESSION, _START = 1, 3, 19
"""Fields of ``/proc/PID/stat`` (proc_pid_stat(5)) behind the program's name."""
_PER_SECOND = 1e9
_Key = tuple[str, int, int, int]
"""A thread: its service, its process, when that was started, and its own number."""


class _Process(NamedTuple):
    parent: int
    session: int
    start: int
    """Ticks since the machine started, which distinguishes a process from a later one with its number."""


class _Nanoseconds(NamedTuple):
    ran: int
    waited: int


class ThreadTimes:
    """Adds up, from call to call, what the threads of services ran, and how long each service waited.

    A service waits as long as the thread of it that ran the most between two calls, as that does its work: threads that
    wait side by side do not make its wait longer, and those that only look for something to do cost nothing.
    """

    def __init__(self, proc: Path = Path("/proc")) -> None:
        self._proc = proc
        self._threads: dict[_Key, _Nanoseconds] = {}
        self._sums: dict[str, _Nanoseconds] = {}
        self._owners: dict[tuple[int, int], str] = {}
        """The service of each process that was seen, by process and start: its parents may have ended since."""
        self.ended = 0
        """Processes that were seen and have ended since."""

    def add_up(self, services: Mapping[int, str]) -> dict[str, tuple[float, float]] | None:
        """Seconds on a processor, and ready without one, by service; None if the kernel does not measure them.

        ``services`` are process ids and names. What their processes have started belongs to them, too. A name ``''``
        is for what descends from a process and belongs to none of the others; the process itself does not count.
        """
        processes, before = self._processes(), self._owners
        self._owners = {
            (pid, process.start): owner
            for pid, process in processes.items()
            if (owner := self._owner(pid, processes, services)) is not None
        }
        self.ended += len(before.keys() - self._owners.keys())
        found: dict[_Key, _Nanoseconds] = {}
        for (pid, start), owner in self._owners.items():
            if owner == services.get(pid) == "":
                continue
            for thread in self._thread_ids(pid):
                times = self._read(pid, thread)
                if times is None:
                    return None
                found[owner, pid, start, thread] = times
        self._add(found)
        totals = {name: self._sums.get(name, _Nanoseconds(0, 0)) for name in {*services.values(), *self._sums} if name}
        totals |= self._sums
        return {name: (ran / _PER_SECOND, waited / _PER_SECOND) for name, (ran, waited) in totals.items()}

    def _add(self, found: Mapping[_Key, _Nanoseconds]) -> None:
        ran: dict[str, int] = defaultdict(int)
        busiest: dict[str, _Nanoseconds] = defaultdict(lambda: _Nanoseconds(0, 0))
        for key, now in found.items():
            before = self._threads.get(key, _Nanoseconds(0, 0))
            if now.ran < before.ran or now.waited < before.waited:  # another thread with its number
                before = _Nanoseconds(0, 0)
            spent = _Nanoseconds(now.ran - before.ran, now.waited - before.waited)
            ran[key[0]] += spent.ran
            busiest[key[0]] = max(busiest[key[0]], spent)
        for name, nanoseconds in ran.items():
            total = self._sums.get(name, _Nanoseconds(0, 0))
            self._sums[name] = _Nanoseconds(total.ran + nanoseconds, total.waited + busiest[name].waited)
        self._threads = dict(found)

    def _processes(self) -> dict[int, _Process]:
        found = {}
        for entry in self._proc.iterdir():
            if entry.name.isdigit():
                try:
                    words = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                except OSError:  # it has ended meanwhile
                    continue
                found[int(entry.name)] = _Process(int(words[_PARENT]), int(words[_SESSION]), int(words[_START]))
        return found

    def _owner(self, pid: int, processes: Mapping[int, _Process], services: Mapping[int, str]) -> str | None:
        """The service that a process belongs to: as when it was first seen, by its ancestors, or by its session."""
        key = pid, processes[pid].start
        if key in self._owners:
            return self._owners[key]
        ancestor, owner = pid, None
        while ancestor in processes and owner is None:
            owner, ancestor = services.get(ancestor), processes[ancestor].parent
        return services.get(processes[pid].session, "") if owner == "" else owner

    def _thread_ids(self, pid: int) -> list[int]:
        try:
            return [int(entry.name) for entry in (self._proc / str(pid) / "task").iterdir()]
        except OSError:  # it has ended meanwhile
            return []

    def _read(self, pid: int, thread: int) -> _Nanoseconds | None:
        """The times of a thread, none for one that has ended; None if the kernel does not measure them."""
        folder = self._proc / str(pid) / "task" / str(thread)
        try:
            words = (folder / "schedstat").read_text().split()
        except OSError:
            return None if (folder / "stat").exists() else _Nanoseconds(0, 0)
        return _Nanoseconds(int(words[0]), int(words[1]))
