"""What the services of a test use so far, and how long they wait for a processor, with all their processes."""

import contextlib
import os
import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.run.machine_load.processes import PROC, Segment, memory, owners, segments, table

_BUSY = (0, 1, 2, 5, 6, 7)
"""Columns of ``/proc/stat`` (proc_stat(5)) in which a core is not free; that of guests is part of the user's."""
_TICKS = os.sysconf("SC_CLK_TCK")
_NANOSECONDS = 1e-9
_SHARED_S, _TIMES_COST = 0.25, 100
"""For how long, and how many times as long as it took to find it out, what processes share is taken to be so."""


class Used(NamedTuple):
    """Seconds on processors and ready to run without one since a service began, and bytes of memory now.

    ``limit`` of memory in bytes, 0 for none. A service that has ended has no memory.
    """

    processor_s: float = 0.0
    waited_s: float = 0.0
    memory: int = 0
    limit: int = 0


@dataclass(frozen=True)
class Snapshot:
    """What the ``services`` of a test used so far; ``at_s`` by the monotonic clock.

    The service ``''`` is for processes that belong to none. ``busy_s`` is how long the ``cores`` that the test may use
    were busy with any process, None where the kernel does not say, or not who waits. ``changes`` is another number when
    processes or threads began or processes ended, whose time may be in no service's account.
    """

    at_s: float
    services: Mapping[str, Used]
    cores: int = 0
    busy_s: float | None = None
    changes: int = 0


class UseReader:
    """Measures from call to call, by one thread."""

    def __init__(self, proc: Path = PROC) -> None:
        self.sized: set[str] = set()
        """The services of which memory is measured, too."""
        self._proc = proc
        self._pids: dict[str, list[int]] = defaultdict(list)
        self._ticks: dict[str, int] = defaultdict(int)
        """What the processes said at last, and what is to be added, as some ended for which nobody waited."""
        self._lost: dict[str, int] = defaultdict(int)
        self._threads: dict[tuple[int, int, str], tuple[int, int]] = {}
        """Nanoseconds that each thread ran and waited, by its process, when that was started, and its own number."""
        self._waited: dict[str, int] = defaultdict(int)
        self._shared: dict[str, tuple[Sequence[int], float, float]] = {}
        """Which part of the memory of some processes counts, and until when that is taken to be so."""
        self._ended = 0
        """Processes that were seen and have ended since."""

    def take(self, services: Mapping[int, str]) -> Snapshot:
        """What ``services`` use, which are the ids of their first processes, and names; that of ``''`` is not counted.

        Time of processes that ended counts as far as it was seen, or as another one waited for them.
        """
        before = {pid for pids in self._pids.values() for pid in pids}
        known, self._pids = table(self._proc, before), defaultdict(list)
        owned = {pid: name for pid, name in owners(services, known).items() if name or services.get(pid) != ""}
        for pid, name in owned.items():
            self._pids[name].append(pid)
        self._ended += len(before - owned.keys())
        for name in {*filter(None, services.values()), *self._ticks, *self._pids}:
            ticks = sum(known[pid].ticks for pid in self._pids[name])
            self._lost[name] += max(self._ticks[name] - ticks, 0)
            self._ticks[name] = ticks
        self._add_waits({pid: (name, known[pid].start) for pid, name in owned.items()})
        cores, memories = os.sched_getaffinity(0), segments(self._proc) if self.sized else []
        found = {}
        for name in self._ticks:
            living = [pid for pid in self._pids[name] if not known[pid].is_zombie]
            size = self._memory(name, living, memories) if living and name in self.sized else 0
            ticks = self._ticks[name] + self._lost[name]
            found[name] = Used(ticks / _TICKS, self._waited[name] * _NANOSECONDS, size)
        return Snapshot(time.monotonic(), found, len(cores), self._busy_s(cores), self._ended + self._begun())

    def _add_waits(self, owned: Mapping[int, tuple[str, int]]) -> None:
        """Adds what services waited since the last call, as long as the thread that ran the most, which does the work.

        Threads that wait side by side do not make the wait longer, and those that only look for something to do cost
        nothing.
        """
        threads, busiest = {}, dict[str, tuple[int, int]]()
        for pid, (name, start) in owned.items():
            for thread, now in _threads(self._proc / str(pid) / "task"):
                key = pid, start, thread
                ran, waited = self._threads.get(key, (0, 0))
                spent = now[0] - ran, now[1] - waited
                busiest[name] = max(busiest.get(name, (0, 0)), spent if min(spent) >= 0 else now)
                threads[key] = now
        for name, (_, waited) in busiest.items():
            self._waited[name] += waited
        self._threads = threads

    def _memory(self, name: str, pids: Sequence[int], memories: Sequence[Segment]) -> int:
        """Bytes; which part of it counts, as processes share it, is found out seldom, and when there are others."""
        size = memory(pids, memories, self._proc)
        among, part, until_s = self._shared.get(name, ((), 1.0, 0.0))
        if pids != among or time.monotonic() >= until_s:
            began = time.thread_time()
            part = min(memory(pids, memories, self._proc, is_exact=True) / max(size, 1), 1.0)
            until_s = time.monotonic() + max(_TIMES_COST * (time.thread_time() - began), _SHARED_S)
            self._shared[name] = pids, part, until_s
        return int(size * part)

    def _busy_s(self, cores: Collection[int]) -> float | None:
        try:
            (self._proc / "self" / "schedstat").stat()
            return busy_s((self._proc / "stat").read_text(), cores)
        except OSError:
            return None

    def _begun(self) -> int:
        """The last number of a process or thread in this process's own namespace; 0 elsewhere, as others begin too."""
        return int((self._proc / "loadavg").read_text().split()[-1]) if os.getpid() == 1 else 0


def _threads(folder: Path) -> Iterable[tuple[str, tuple[int, int]]]:
    """The threads of a process, with the nanoseconds that each ran and waited, if the kernel counts them."""
    with contextlib.suppress(OSError):  # it has ended meanwhile
        for thread in folder.iterdir():
            with contextlib.suppress(OSError):
                ran, waited = map(int, (thread / "schedstat").read_bytes().split()[:2])
                yield thread.name, (ran, waited)


def busy_s(text: str, cores: Iterable[int]) -> float | None:
    """Seconds for which ``cores`` were busy, by the text of ``/proc/stat``; None when it has nothing of one."""
    rows = {words[0]: words[1:] for words in map(str.split, text.splitlines()) if words}
    own = [rows.get(f"cpu{core}", []) for core in cores]
    if any(len(row) <= max(_BUSY) for row in own):
        return None
    return sum(int(row[column]) for row in own for column in _BUSY) / _TICKS
