"""How much of the processor the application took, and how long others kept it waiting, since its processes began.

A wait is excused as far as others than the application used the processors meanwhile. What its children took that have
ended is in the account of its control groups, where it has some (``GROUP``). Elsewhere nobody may know, as with those
for which nobody waits (``SIG_IGN`` for ``SIGCHLD``): there, an answer during which processes or threads came and went
has no excuse.
"""

import contextlib
import math
import os
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

_LOOK_AGAIN = 20
"""Looks after which new processes of the application are looked for again, and sooner where some began."""
GROUP = "dodo-"
"""How the names of control groups begin that hold one service of the application, and nothing else."""
_MOST_READ = 1 << 16
_TICK_S = 1 / os.sysconf("SC_CLK_TCK")
_BUSY = (0, 1, 2, 5, 6, 7)
"""Columns of ``/proc/stat`` (proc_pid_stat(5)) in which a core is not free: user, nice, system, interrupts, stolen."""


class Spent(NamedTuple):
    """Seconds on a processor, and ready to run without one."""

    ran_s: float
    waited_s: float


class ThreadSpent(NamedTuple):
    """Seconds that a thread has run, and that it was ready to run and did not."""

    ran_s: float
    waited_s: float


class Account(NamedTuple):
    """What was used at a moment, in s: by the application with all that ended, None where nobody knows, and by all.

    ``begun`` is the last number of a process or thread that was given, None where those of others have the same ones.
    """

    application_s: float | None
    machine_s: float
    begun: int | None


class ProcessorTimes(NamedTuple):
    """What processes have spent up to now, by process id: processor time in s, and the times of each thread."""

    ran_s: Mapping[int, float]
    threads: Mapping[int, Mapping[str, ThreadSpent]]
    account: Account | None = None
    """None if there was none to be made: then all that is waited is excused."""

    def since(self, before: "ProcessorTimes", excused_s: float = 0.0) -> Spent:
        """What was spent since another snapshot. A process waits as long as the one of its threads that ran the most.

        ``excused_s`` of what others took is an excuse for something else already.

        Others may have nothing to do and be ready all the same, such as those of OpenCV's pool, which look for work
        for a while before they sleep: on a busy machine they wait much longer than the work takes.
        """
        most_s = max(self._others_s(before) - excused_s, 0.0)
        return Spent(self._ran_s(before), min(sum(self._waits(before)), most_s))

    def by_others(self, before: "ProcessorTimes", waited_s: float) -> float:
        """The part of a wait of the clock's own that falls to others than the application."""
        others_s = self._others_s(before)
        return min(waited_s * _share(others_s, self._ran_s(before)), others_s)

    def longest_wait(self, before: "ProcessorTimes") -> float:
        """Seconds that others kept the process waiting which they kept the longest since another snapshot."""
        return min(max(self._waits(before), default=0.0), self._others_s(before))

    def _waits(self, before: "ProcessorTimes") -> list[float]:
        """The part of each process's wait that falls to others, by what they and the application's others took."""
        ran_s, others_s = self._ran_s(before), self._others_s(before)
        waits = []
        for pid, threads in self.threads.items():
            own = _busiest(threads, before.threads.get(pid, {}))
            waits.append(own.waited_s * _share(others_s, max(ran_s - own.ran_s, 0.0)))
        return waits

    def _ran_s(self, before: "ProcessorTimes") -> float:
        ran = sum(max(now - before.ran_s.get(pid, now), 0.0) for pid, now in self.ran_s.items())
        if self.account and before.account:
            now, then = self.account.application_s, before.account.application_s
            return ran if now is None or then is None else max(now - then, ran)
        return ran

    def _others_s(self, before: "ProcessorTimes") -> float:
        """What others took at most since another snapshot: the kernel's figure of all is one of whole ticks."""
        if self.account is None or before.account is None:
            return math.inf
        now, then = self.account, before.account
        if now.application_s is None and (now.begun != then.begun or before.ran_s.keys() - self.ran_s.keys()):
            return 0.0
        return max(now.machine_s - then.machine_s - self._ran_s(before), 0.0) + _TICK_S


def _share(others_s: float, application_s: float) -> float:
    """That of others in what they and the application took of the processors."""
    return 1.0 if application_s == 0 or math.isinf(others_s) else others_s / (others_s + application_s)


NOTHING = ProcessorTimes({}, {})


class ApplicationProcesses:
    """The application's processes: those of ``roots``, and what they started. Empty where they cannot be seen."""

    def __init__(self, roots: Iterable[int], proc: Path = Path("/proc")) -> None:
        self._roots, self._proc = frozenset(roots), proc
        self._stat, self._load = f"{proc}/stat", f"{proc}/loadavg"
        self._pids: tuple[int, ...] = ()
        self._looks = 0
        self._begun: int | None = None
        self._groups = {root: _group_of(root, proc) for root in self._roots}
        self._used: dict[int, float] = {}
        """What the groups said at last: they go with their services."""

    def __bool__(self) -> bool:
        return bool(self._roots)

    def snapshot(self) -> ProcessorTimes:
        """What they have spent up to now, without those that have ended."""
        account = self._account()
        begun = account.begun if account else None
        if self._looks % _LOOK_AGAIN == 0 or begun != self._begun:
            self._pids = tuple(descendants(self._roots, self._proc))
        self._looks, self._begun = self._looks + 1, begun
        ran: dict[int, float] = {}
        for pid in self._pids:
            with contextlib.suppress(OSError):
                ran[pid] = _process_clock(pid)
        threads = {pid: dict(_threads(f"{self._proc}/{pid}/task")) for pid in self._pids}
        return ProcessorTimes(ran, threads, account)

    def _account(self) -> Account | None:
        with contextlib.suppress(OSError, ValueError):
            machine_s = busy_s(_read(self._stat), os.sched_getaffinity(0))
            begun = int(_read(self._load).split()[-1]) if os.getppid() == 1 else None
            return Account(self._used_by_groups(), machine_s, begun)
        return None

    def _used_by_groups(self) -> float | None:
        """None if a service does not have its own group."""
        for root, group in self._groups.items():
            if group is None:
                return None
            with contextlib.suppress(OSError, ValueError, StopIteration):
                self._used[root] = _used_s(group)
        return sum(self._used.values())


def busy_s(text: bytes, cores: Collection[int]) -> float:
    """Seconds for which any process ran on these cores, by the text of ``/proc/stat``."""
    ticks = 0
    for line in text.splitlines():
        name, *numbers = line.split()
        if name[:3] != b"cpu":
            break
        if name[3:] and int(name[3:]) in cores:
            ticks += sum(int(numbers[column]) for column in _BUSY if column < len(numbers))
    return ticks * _TICK_S


def _read(path: str) -> bytes:
    """What a file holds, which several are read for twice a frame: pathlib would take five times as long."""
    file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.read(file, _MOST_READ)
    finally:
        os.close(file)


def _group_of(pid: int, proc: Path) -> Path | None:
    """The file by which a service's own control group gives its processor time (cgroups(7), version 1 or 2)."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        mounts = [line.split() for line in (proc / "self" / "mountinfo").read_text().splitlines()]
        for line in (proc / str(pid) / "cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if not Path(path).name.startswith(GROUP) or (controllers and "cpuacct" not in controllers.split(",")):
                continue
            for mount in mounts:
                kind, options = mount[mount.index("-") + 1], mount[-1].split(",")
                is_it = "cpuacct" in options if controllers else kind == "cgroup2"
                if is_it and Path(path).is_relative_to(mount[3]):
                    folder = Path(mount[4]) / Path(path).relative_to(mount[3])
                    file = folder / ("cpuacct.usage" if controllers else "cpu.stat")
                    if file.is_file():
                        return file
    return None


def _used_s(group: Path) -> float:
    """Seconds, by ``cpuacct.usage`` in ns or ``cpu.stat`` with a row in us."""
    text = _read(str(group))
    if b" " not in text:
        return int(text) / 1e9
    return next(int(row.split()[1]) for row in text.splitlines() if row.startswith(b"usage_usec ")) / 1e6


def own_wait_s(schedstat: str = "/proc/thread-self/schedstat") -> float:
    """How long this thread has been ready to run without a processor, in s; 0 if the kernel does not say."""
    with contextlib.suppress(OSError, ValueError):
        _, waited, *_ = _read(schedstat).split()
        return int(waited) / 1e9
    return 0.0


def contention_s(pressure: Path = Path("/proc/pressure/cpu")) -> float:
    """For how long any process of this machine has been ready to run without a processor; 0 if it is not counted.

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
    """The threads of a process by their ids: the first two numbers of schedstat are times in ns."""
    with contextlib.suppress(OSError):
        for thread in os.listdir(tasks):  # noqa: PTH208
            with contextlib.suppress(OSError, ValueError):
                ran, waited, *_ = _read(f"{tasks}/{thread}/schedstat").split()
                yield thread, ThreadSpent(int(ran) / 1e9, int(waited) / 1e9)


def _busiest(now: Mapping[str, ThreadSpent], before: Mapping[str, ThreadSpent]) -> ThreadSpent:
    """What the thread ran and waited that ran the most in between; nothing if none ran."""
    spent = [
        ThreadSpent(times.ran_s - then.ran_s, times.waited_s - then.waited_s) for times, then in _both(now, before)
    ]
    ran_s, waited_s = max(spent, default=(0.0, 0.0))
    return ThreadSpent(max(ran_s, 0.0), max(waited_s, 0.0))


def _both(
    now: Mapping[str, ThreadSpent], before: Mapping[str, ThreadSpent]
) -> Iterator[tuple[ThreadSpent, ThreadSpent]]:
    return ((times, before.get(thread, ThreadSpent(0.0, 0.0))) for thread, times in now.items())


def _parent(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except (OSError, ValueError, IndexError):
        return 0
