"""What a test's processes and the machine have used so far, at one moment."""

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from dodo_dsl.run.machine_load.processes import PROC, ThreadTimes

_USER, _NICE, _SYSTEM, _IRQ, _SOFTIRQ, _STEAL = 0, 1, 2, 5, 6, 7
_BUSY = (_USER, _NICE, _SYSTEM, _IRQ, _SOFTIRQ, _STEAL)
"""Columns of ``/proc/stat`` (proc_pid_stat(5)) in which a core is not free; that of guests is part of the user's."""


class Times(NamedTuple):
    """Seconds on processors, of all threads, and ready to run without one, of the thread that runs the most."""

    ran_s: float
    waited_s: float


@dataclass(frozen=True)
class Snapshot:
    """Sums since some time in the past; ``at_s`` by a clock that never goes back.

    ``services`` are the test's, by name; processes that belong to none of them have the name ``''``.
    ``busy_s`` is how long the ``cores`` that the test may use were busy, with any process. ``changes`` is another one
    when processes or threads began or processes ended, whose time may be in no service's account.
    """

    at_s: float
    cores: int
    busy_s: float
    services: Mapping[str, Times]
    changes: int = 0


def with_ended(taken: Snapshot, took_s: Mapping[str, float | None], ended: int, proc: Path = PROC) -> Snapshot:
    """With the time of the application's processes that ended, ``took_s`` by service, None where nobody counts it.

    ``ended`` is how many processes have ended that were seen.
    """
    services = {
        name: times._replace(ran_s=max(times.ran_s, took_s.get(name) or 0.0)) for name, times in taken.services.items()
    }
    if None not in took_s.values():
        return replace(taken, services=services)
    begun = int((proc / "loadavg").read_text().split()[-1]) if os.getpid() == 1 else 0
    return replace(taken, services=services, changes=ended + begun)


def take(times: ThreadTimes, services: Mapping[int, str], proc: Path = PROC) -> Snapshot | None:
    """A snapshot of ``services``, which are process ids and names; None if the kernel does not measure."""
    cores = os.sched_getaffinity(0)
    found = times.add_up(services)
    try:
        busy = busy_s((proc / "stat").read_text(), cores)
    except OSError:
        return None
    if found is None or busy is None:
        return None
    spent = {name: Times(*sums) for name, sums in found.items()}
    return Snapshot(time.monotonic(), len(cores), busy, spent)


def busy_s(text: str, cores: Iterable[int]) -> float | None:
    """Seconds for which ``cores`` were busy, by the text of ``/proc/stat``; None when it has nothing of one."""
    rows = {words[0]: words[1:] for words in map(str.split, text.splitlines()) if words}
    ticks = 0
    for core in cores:
        row = rows.get(f"cpu{core}", [])
        if len(row) <= _STEAL:
            return None
        ticks += sum(int(row[column]) for column in _BUSY)
    return ticks / os.sysconf("SC_CLK_TCK")
