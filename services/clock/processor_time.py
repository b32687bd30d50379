"""How much of the processor the application took, and how long it waited for it, since its processes began."""

import contextlib
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

_LOOK_AGAIN = 20
"""Frames after which new processes of the application are looked for again."""


class Spent(NamedTuple):
    """Seconds on a processor, and ready to run without one; sums over processes and threads."""

    ran_s: float
    waited_s: float

    def since(self, before: "Spent") -> "Spent":
        """The difference; nothing is negative where a process has ended in between."""
        return Spent(max(self.ran_s - before.ran_s, 0.0), max(self.waited_s - before.waited_s, 0.0))


NOTHING = Spent(0.0, 0.0)


class ApplicationProcesses:
    """The application's processes: those of ``roots``, and what they started. Empty where they cannot be seen."""

    def __init__(self, roots: Iterable[int], proc: Path = Path("/proc")) -> None:
        self._roots, self._proc = frozenset(roots), proc
        self._pids: tuple[int, ...] = ()
        self._looks = 0

    def __bool__(self) -> bool:
        return bool(self._roots)

    def spent(self) -> Spent:
        """What all of them have spent up to now; those that have ended count no more."""
        if self._looks % _LOOK_AGAIN == 0:
            self._pids = tuple(descendants(self._roots, self._proc))
        self._looks += 1
        ran = waited = 0.0
        for pid in self._pids:
            with contextlib.suppress(OSError):
                ran += _process_clock(pid)
            waited += _waited(self._proc / str(pid) / "task")
        return Spent(ran, waited)


def descendants(roots: frozenset[int], proc: Path) -> list[int]:
    """The roots and all processes that descend from them."""
    parents = {int(entry.name): _parent(entry / "stat") for entry in proc.iterdir() if entry.name.isdigit()}
    found = set(roots & parents.keys())
    grown = True
    while grown:
        more = {pid for pid, parent in parents.items() if parent in found} - found
        found |= more
        grown = bool(more)
    return sorted(found)


def _process_clock(pid: int) -> float:
    """The processor time of a process with all its threads, also those that ended (clock_getcpuclockid)."""
    return time.clock_gettime_ns((~pid << 3) | 2) / 1e9


def _waited(tasks: Path) -> float:
    """Seconds that the threads of a process were ready to run and did not: the second number of schedstat, ns."""
    total = 0.0
    with contextlib.suppress(OSError):
        for task in tasks.iterdir():
            with contextlib.suppress(OSError, ValueError, IndexError):
                total += int((task / "schedstat").read_bytes().split()[1]) / 1e9
    return total


def _parent(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0
