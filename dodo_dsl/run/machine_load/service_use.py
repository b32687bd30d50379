"""What services use so far, with all their processes: by ``/proc``, or of a container by its control group.

The kernel counts for control groups of versions 1 and 2.
"""

import contextlib
import os
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.run.machine_load.processes import PROC, held, of_service, proportional, resident, segments

_STATE, _PARENT, _TIMES = 0, 1, slice(11, 15)
"""Fields of ``/proc/PID/stat`` (proc_pid_stat(5)) behind the program's name; times are those of it and its children."""
_TICKS = os.sysconf("SC_CLK_TCK")
_LOOK_S = 0.25
"""After how long at least new processes, and files in memory, are looked for again."""
_SMALL = 4 << 20
"""Bytes up to which it does not matter how much of a process's memory others share."""
_TIMES_COST = 100
"""How many times as long as a look took, or to find out what processes share, that is taken to be so."""
_TRIES = 3


class Used(NamedTuple):
    """Seconds on processors since a service began, and bytes of memory now; ``limit`` in bytes, 0 for none.

    A service that has ended has no memory.
    """

    processor_s: float
    memory: int
    limit: int = 0


class _Process(NamedTuple):
    parent: int
    ticks: int
    """On processors, with those of its children that it waited for."""
    is_zombie: bool


class _Sharing(NamedTuple):
    """Which part of the memory of some processes counts, because it is partly the same, and until when."""

    part: float
    among: Set[int]
    until_s: float


class UseReader:
    """Measures from call to call. ``take`` costs a tenth of a millisecond a service; use it from one thread."""

    def __init__(self, proc: Path = PROC) -> None:
        self._proc = proc
        self._look_at_s = float("-inf")
        self._pids: dict[str, list[int]] = {}
        self._held: dict[str, int] = {}
        self._detached: dict[str, int] = {}
        self._sharing: dict[str, _Sharing] = defaultdict(lambda: _Sharing(1.0, frozenset(), float("-inf")))
        self._ticks: dict[str, int] = defaultdict(int)
        """What the processes said at last, and what is to be added, as some ended for which nobody waited."""
        self._lost: dict[str, int] = defaultdict(int)

    def take(self, services: Mapping[int, str]) -> dict[str, Used]:
        """What services use, by name; ``services`` are the ids of their first processes, and names."""
        now = time.monotonic()
        if now >= self._look_at_s:
            self._look(services)
        found: dict[str, Used] = {}
        for pid, name in services.items():
            self._add_children(name)
            alive = self._count(pid, name, services)
            ticks = self._ticks[name] + self._lost[name]
            found[name] = Used(ticks / _TICKS, self._memory(name, alive, now) if alive else 0)
        return found

    def note_end(self, pid: int, name: str) -> None:
        """Takes the last figures of a service whose first process ended, and has not been waited for."""
        if (process := self._read(pid)) is not None:
            self._set(name, process.ticks)
            self._pids[name] = []

    def _look(self, services: Mapping[int, str]) -> None:
        """Finds the processes of services, ancestors first."""
        began = time.thread_time()
        known = {int(e.name): p for e in self._proc.iterdir() if e.name.isdigit() and (p := self._read(int(e.name)))}
        found: dict[str, list[tuple[int, int]]] = {name: [] for name in services.values()}
        for pid in known:
            ancestor, depth = pid, 0
            while ancestor in known and ancestor not in services:
                ancestor, depth = known[ancestor].parent, depth + 1
            if ancestor in services:
                found[services[ancestor]].append((depth, pid))
        self._pids = {name: [pid for _, pid in sorted(pids)] for name, pids in found.items()}
        memories = segments(self._proc)
        for name, pids in self._pids.items():
            attached, self._detached[name] = of_service(memories, pids, self._proc)
            self._held[name] = held(pids, self._proc) + attached
        self._look_at_s = time.monotonic() + _patience_s(began)

    def _add_children(self, name: str) -> None:
        """Adds what known processes have started since the last look, which is cheap to read.

        A sandbox that is just being set up has not started the service yet. Other threads' children wait for the look.
        """
        pids = self._pids.get(name, [])
        for pid in pids:  # which grows: children have children
            with contextlib.suppress(OSError), open(f"{self._proc}/{pid}/task/{pid}/children", "rb") as file:  # noqa: PTH123
                pids += [child for child in map(int, file.read().split()) if child not in pids]

    def _count(self, first: int, name: str, services: Mapping[int, str]) -> list[int]:
        """Adds up the processor time of a service; returns its processes.

        A process that is waited for is in its parent's time from then on, so that one which ends in between would be
        missed: then all are read again.
        """
        for _ in range(_TRIES):
            read = {pid: self._read(pid) for pid in self._pids.get(name, ())}
            processes = {pid: process for pid, process in read.items() if process is not None}
            if len(processes) == len(read):
                break
            self._look(services)
        if first in processes:
            self._set(name, sum(process.ticks for process in processes.values()))
        return [pid for pid, process in processes.items() if not process.is_zombie]

    def _set(self, name: str, ticks: int) -> None:
        self._lost[name] += max(self._ticks[name] - ticks, 0)
        self._ticks[name] = ticks

    def _memory(self, name: str, pids: Iterable[int], now: float) -> int:
        """Bytes of all processes; one that began since then counts at the next update."""
        sizes = {pid: resident(pid, self._proc) for pid in pids}
        large = {pid for pid, size in sizes.items() if sum(size) > _SMALL}
        part, detached = 1.0, self._detached.get(name, 0)
        if len(large) > 1:
            sharing = self._shared(name, large, sizes, now)
            known = {pid: size for pid, size in sizes.items() if pid not in large - sharing.among}
            if not large & sharing.among:
                return max(map(sum, sizes.values())) + detached
            part, sizes = sharing.part, known
        anonymous, shared = (sum(parts) for parts in zip(*sizes.values(), strict=True))
        return int((anonymous + max(shared, self._held.get(name, 0))) * part) + detached

    def _shared(self, name: str, large: Set[int], sizes: Mapping[int, tuple[int, int]], now: float) -> _Sharing:
        """Which part of their memory counts, by the kernel's last figures of processes that stayed as they were."""
        sharing = self._sharing[name]
        if now >= sharing.until_s:
            began = time.thread_time()
            theirs = {pid: sum(proportional(pid, self._proc)) for pid in large}
            after = {pid: sum(resident(pid, self._proc)) for pid in large}
            before, every = sum(sum(sizes[pid]) for pid in large), sum(map(sum, sizes.values()))
            if abs(sum(after.values()) - before) <= _SMALL * len(large):  # else others have now what one gave back
                is_known = all(theirs[pid] for pid in large if after[pid])  # not readable for everybody
                part = min(1 - (before - sum(theirs.values())) / every, 1.0) if is_known else 1.0
                sharing = _Sharing(part, frozenset(large), now)
            sharing = self._sharing[name] = sharing._replace(until_s=now + _patience_s(began))
        return sharing

    def _read(self, pid: int) -> _Process | None:
        try:
            with open(f"{self._proc}/{pid}/stat", "rb", buffering=0) as file:  # noqa: PTH123
                words = file.read().rpartition(b")")[2].split()
        except OSError:
            return None
        return _Process(int(words[_PARENT]), sum(map(int, words[_TIMES])), words[_STATE] == b"Z")


def _patience_s(began: float) -> float:
    """Seconds to the next time for what began at a processor time of this thread, so that it takes little of it."""
    return max(_TIMES_COST * (time.thread_time() - began), _LOOK_S)


_NANOSECONDS, _MICROSECONDS = 1e-9, 1e-6
_MOST = 4096
_OF_1 = ("total_rss", "total_shmem")
_OF_2 = ("anon", "shmem")
"""Anonymous and shared memory in ``memory.stat``; copies of files do not count, which the kernel drops when it must."""


@dataclass(frozen=True)
class ControlGroup:
    """The files with memory and processor time; ``tick_s`` is the unit of the latter."""

    memory: Path
    processor: Path
    tick_s: float

    def used(self) -> Used | None:
        """What was used so far; None if the kernel does not report it, or when the group is gone."""
        try:
            memory = memory_of(numbers(self.memory.read_text()))
            text = self.processor.read_text()
        except (OSError, ValueError):
            return None
        ticks = numbers(text).get("usage_usec") if " " in text else int(text)
        return None if memory is None or ticks is None else Used(ticks * self.tick_s, memory)


def processor_s(descriptor: int) -> float | None:
    """Seconds by an open ``cpuacct.usage`` or ``cpu.stat``; None if the kernel does not report it."""
    try:
        text = os.pread(descriptor, _MOST, 0).decode()
        ticks = numbers(text).get("usage_usec") if " " in text else int(text)
    except (OSError, ValueError):
        return None
    return None if ticks is None else ticks * (_MICROSECONDS if " " in text else _NANOSECONDS)


def of_process(pid: int, proc: Path = Path("/proc")) -> ControlGroup | None:
    """The control group of a process; None if it has none that counts both, as without the controller of memory."""
    try:
        mounts = (proc / "self" / "mountinfo").read_text()
        groups = (proc / str(pid) / "cgroup").read_text()
    except OSError:
        return None
    places = _places(mounts, groups)
    memory, processor = places.get("memory"), places.get("cpuacct")
    if memory and processor:
        return ControlGroup(memory / "memory.stat", processor / "cpuacct.usage", _NANOSECONDS)
    unified = places.get("")
    if unified and (unified / "memory.stat").is_file():
        return ControlGroup(unified / "memory.stat", unified / "cpu.stat", _MICROSECONDS)
    return None


def memory_of(stat: Mapping[str, int]) -> int | None:
    """Bytes of memory by the rows of ``memory.stat``; None if they do not have it."""
    names = _OF_1 if _OF_1[0] in stat else _OF_2
    return stat[names[0]] + stat.get(names[1], 0) if names[0] in stat else None


def of_engine(stats: Mapping[str, Any]) -> Used | None:
    """What the engine says of a container (``GET /containers/ID/stats``); None if it does not know."""
    try:
        memory = memory_of(stats["memory_stats"]["stats"])
        return None if memory is None else Used(stats["cpu_stats"]["cpu_usage"]["total_usage"] * _NANOSECONDS, memory)
    except (KeyError, TypeError):
        return None


def numbers(text: str) -> dict[str, int]:
    """Rows of a name and a number."""
    return {name: int(number) for name, number in (line.split() for line in text.splitlines())}


def _places(mounts: str, groups: str) -> dict[str, Path]:
    """The folder of a process's group by controller, that of version 2 under an empty name.

    ``mounts`` and ``groups`` are the texts of ``mountinfo`` and ``cgroup`` (proc_pid_mountinfo(5), cgroups(7)).
    """
    paths: dict[str, str] = {}
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        paths |= dict.fromkeys(controllers.split(","), path)
    found: dict[str, Path] = {}
    for line in mounts.splitlines():
        before, _, after = line.partition(" - ")
        root, point = before.split()[3:5]
        kind, _, options = after.split()[:3]
        names = options.split(",") if kind == "cgroup" else [""] if kind == "cgroup2" else []
        for name in names:
            if name in paths and (place := _below(paths[name], root)) is not None:
                found.setdefault(name, Path(point + place))
    return found


def _below(path: str, root: str) -> str | None:
    """A group's path in a mount that shows only what is below ``root``; None if it is not shown."""
    if root == "/":
        return path
    return path.removeprefix(root) if path == root or path.startswith(f"{root}/") else None
