"""How much of the processor the application took, and how long it waited for it, since its processes began."""

import contextlib
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

_LOOK_AGAIN = 20
"""Frames after which new processes of the application are looked for again."""


class Spent(NamedTuple):
    """Seconds on a processor, and ready to run without one."""

    ran_s: float
    waited_s: float


class ThreadSpent(NamedTuple):
    """Seconds that a thread has run, and that it was ready to run and did not."""

    ran_s: float
    waited_s: float


class ProcessorTimes(NamedTuple):
    """What processes have spent up to now, by process id: processor time in s, and the times of each thread."""

    ran_s: Mapping[int, float]
    threads: Mapping[int, Mapping[str, ThreadSpent]]

    def since(self, before: "ProcessorTimes") -> Spent:
        """What was spent since another snapshot. A process waits as long as the one of its threads that ran the most.

        Others may have nothing to do and be ready all the same, such as those of OpenCV's pool, which look for work
        for a while before they sleep: on a busy machine they wait much longer than the work takes.
        """
        ran = sum(max(now - before.ran_s.get(pid, now), 0.0) for pid, now in self.ran_s.items())
        return Spent(ran, sum(self._waits(before)))

    def longest_wait(self, before: "ProcessorTimes") -> float:
        """Seconds that the process waited which waited the longest since another snapshot."""
        return max(self._waits(before), default=0.0)

    def _waits(self, before: "ProcessorTimes") -> list[float]:
        return [_wait(threads, before.threads.get(pid, {})) for pid, threads in self.threads.items()]


NOTHING = ProcessorTimes({}, {})


class ApplicationProcesses:
    """The application's processes: those of ``roots``, and what they started. Empty where they cannot be seen."""

    def __init__(self, roots: Iterable[int], proc: Path = Path("/proc")) -> None:
        self._roots, self._proc = frozenset(roots), proc
        self._pids: tuple[int, ...] = ()
        self._looks = 0

    def __bool__(self) -> bool:
        return bool(self._roots)

    def snapshot(self) -> ProcessorTimes:
        """What they have spent up to now, without those that have ended."""
        if self._looks % _LOOK_AGAIN == 0:
            self._pids = tuple(descendants(self._roots, self._proc))
        self._looks += 1
        ran: dict[int, float] = {}
        for pid in self._pids:
            with contextlib.suppress(OSError):
                ran[pid] = _process_clock(pid)
        return ProcessorTimes(ran, {pid: dict(_threads(f"{self._proc}/{pid}/task")) for pid in self._pids})


def own_wait_s(schedstat: Path = Path("/proc/thread-self/schedstat")) -> float:
    """How long this thread has been ready to run without a processor, in s; 0 where the kernel does not say."""
    with contextlib.suppress(OSError, ValueError):
        _, waited, *_ = schedstat.read_bytes().split()
        return int(waited) / 1e9
    return 0.0


def contention_s(pressure: Path = Path("/proc/pressure/cpu")) -> float:
    """For how long any process of this machine has been ready to run without a processor; 0 where it is not counted.

    The kernel's pressure stall information (its Documentation/accounting/psi.rst), also inside a container: the total
    of the line "some", in us.
    """
    with contextlib.suppress(OSError, ValueError):
        some, _, total = pressure.read_text().partition("\n")[0].rpartition("total=")
        return int(total) / 1e6 if some.startswith("some ") else 0.0
    return 0.0


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


def _threads(tasks: str) -> Iterator[tuple[str, ThreadSpent]]:
    """The threads of a process by their ids: the first two numbers of schedstat are times in ns.

    This is done twice a frame while the application waits, and pathlib would take five times as long.
    """
    with contextlib.suppress(OSError):
        for thread in os.listdir(tasks):  # noqa: PTH208
            with contextlib.suppress(OSError, ValueError):
                file = os.open(f"{tasks}/{thread}/schedstat", os.O_RDONLY | os.O_CLOEXEC)
                try:
                    ran, waited, *_ = os.read(file, 100).split()
                finally:
                    os.close(file)
                yield thread, ThreadSpent(int(ran) / 1e9, int(waited) / 1e9)


def _wait(now: Mapping[str, ThreadSpent], before: Mapping[str, ThreadSpent]) -> float:
    """How long the thread waited that ran the most in between; nothing where none ran."""
    spent = [(times.ran_s - then.ran_s, times.waited_s - then.waited_s) for times, then in _both(now, before)]
    return max(max(spent, default=(0.0, 0.0))[1], 0.0)


def _both(
    now: Mapping[str, ThreadSpent], before: Mapping[str, ThreadSpent]
) -> Iterator[tuple[ThreadSpent, ThreadSpent]]:
    return ((times, before.get(thread, ThreadSpent(0.0, 0.0))) for thread, times in now.items())


def _parent(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0
