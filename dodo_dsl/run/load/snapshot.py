"""What a test's processes and the machine have used so far, at one moment."""

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.run.load.thread_times import ThreadTimes

PROC = Path("/proc")
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
    ``busy_s`` is how long the ``cores`` that the test may use were busy, with any process.
    """

    at_s: float
    cores: int
    busy_s: float
    services: Mapping[str, Times]


def take(times: ThreadTimes, services: Mapping[int, str], proc: Path = PROC) -> Snapshot | None:
    """A snapshot of ``services``, which are process ids and names; None where the kernel does not measure."""
    cores = os.sched_getaffinity(0)
    found = times.add_up(services)
    try:
        busy = busy_s((proc / "stat").read_text(), cores)
    except OSError:
        return None
    if found is None or busy is None:
        return None
    return Snapshot(time.monotonic(), len(cores), busy, {name: Times(*sums) for name, sums in found.items()})


def busy_s(text: str, cores: Iterable[int]) -> float | None:
    """Seconds for which ``cores`` were busy, by the text of ``/proc/stat``; None when it tells nothing of one."""
    rows = {words[0]: words[1:] for words in map(str.split, text.splitlines()) if words}
    ticks = 0
    for core in cores:
        row = rows.get(f"cpu{core}", [])
        if len(row) <= _STEAL:
            return None
        ticks += sum(int(row[column]) for column in _BUSY)
    return ticks / os.sysconf("SC_CLK_TCK")


def to_json(snapshot: Snapshot | None) -> dict[str, Any] | None:
    return None if snapshot is None else asdict(snapshot)


def from_json(text: Mapping[str, Any] | None) -> Snapshot | None:
    if text is None:
        return None
    return Snapshot(**{**text, "services": {name: Times(*sums) for name, sums in text["services"].items()}})
