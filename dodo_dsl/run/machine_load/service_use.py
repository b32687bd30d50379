"""What the services of a test use so far, and how long they wait for a processor, with all their processes."""

import contextlib
import os
import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.run.machine_load.processes import PROC, memory, owners, segments, table

_BUSY = (0, 1, 2, 5, 6, 7)
"""Columns of ``/proc/stat`` (proc_stat(5)) in which a core is not free; that of guests is part of the user's."""
_TICKS = os.sysconf("SC_CLK_TCK")
_NANOSECONDS = 1e-9


class Used(NamedTuple):
    """Seconds on processors and ready to run without one since a service began, and bytes of memory now."""

    processor_s: float = 0.0
    waited_s: float = 0.0
    memory: int = 0


@dataclass(frozen=True)
class Snapshot:
    """What the ``services`` of a test used so far; ``at_s`` by the monotonic clock.

    The service ``''`` is for processes that belong to none. ``busy_s`` is how long the ``cores`` that the test may use
    were busy with any process, None where the kernel does not say, or not who waits.
    """

    at_s: float
    services: Mapping[str, Used]
    cores: int = 0
    busy_s: float | None = None


class UseReader:
    """Measures from call to call, by one thread."""

    def __init__(self, proc: Path = PROC) -> None:
        self.sized: set[str] = set()
        """The services of which memory is measured, too."""
        self._proc = proc
        self._ticks: dict[str, int] = defaultdict(int)
        """What the processes said at last, and what is to be added, as some ended for which nobody waited."""
        self._lost: dict[str, int] = defaultdict(int)
        self._threads: dict[tuple[int, int, str], tuple[int, int]] = {}
        """Nanoseconds that each thread ran and waited, by its process, when that was started, and its own number."""
        self._waited: dict[str, int] = defaultdict(int)

    def take(self, services: Mapping[int, str]) -> Snapshot:
        """What ``services`` use, which are the ids of their first processes, and names; that of ``''`` is not counted.

        Time of processes that ended counts as far as it was seen, or as another one waited for them.
        """
        known, pids = table(self._proc), defaultdict[str, list[int]](list)
        owned = {pid: name for pid, name in owners(services, known).items() if name or services.get(pid) != ""}
        for pid, name in owned.items():
            pids[name].append(pid)
        self._add_waits({pid: (name, known[pid].start) for pid, name in owned.items()})
        cores, memories = os.sched_getaffinity(0), segments(self._proc) if self.sized else []
        found = {}
        for name in {*filter(None, services.values()), *self._ticks, *pids}:
            ticks = sum(known[pid].ticks for pid in pids[name])
            self._lost[name] += max(self._ticks[name] - ticks, 0)
            self._ticks[name] = ticks
            living = [pid for pid in pids[name] if not known[pid].is_zombie]
            size = memory(living, memories, self._proc) if living and name in self.sized else 0
            found[name] = Used((ticks + self._lost[name]) / _TICKS, self._waited[name] * _NANOSECONDS, size)
        return Snapshot(time.monotonic(), found, len(cores), self._busy_s(cores))

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

    def _busy_s(self, cores: Collection[int]) -> float | None:
        """Seconds for which ``cores`` were busy; None where the kernel does not say, or not who waits."""
        try:
            (self._proc / "self" / "schedstat").stat()
            text = (self._proc / "stat").read_text()
        except OSError:
            return None
        rows = {words[0]: words[1:] for words in map(str.split, text.splitlines()) if words}
        own = [rows.get(f"cpu{core}", []) for core in cores]
        if any(len(row) <= max(_BUSY) for row in own):
            return None
        return sum(int(row[column]) for row in own for column in _BUSY) / _TICKS


def _threads(folder: Path) -> Iterable[tuple[str, tuple[int, int]]]:
    """The threads of a process, with the nanoseconds that each ran and waited, if the kernel counts them."""
    with contextlib.suppress(OSError):  # it has ended meanwhile
        for thread in folder.iterdir():
            with contextlib.suppress(OSError):
                ran, waited = map(int, (thread / "schedstat").read_bytes().split()[:2])
                yield thread.name, (ran, waited)
