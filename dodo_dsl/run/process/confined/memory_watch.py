"""Memory of the application's services, as ``/proc`` tells it: without cgroups, which not every machine hands out."""

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path

PERIOD_S = 0.25
_RESIDENT = ("RssAnon:", "RssShmem:")
_PROPORTIONAL = ("Pss_Anon:", "Pss_Shmem:")


def above(limits: Mapping[int, int], parents: Mapping[int, int], proc: Path = Path("/proc")) -> dict[int, int]:
    """Bytes of memory that a process uses with all that descend from it, of those which use more than their limit.

    ``limits`` are bytes by process id, ``parents`` those of all processes. Programs and files that are only read do not
    count, and what processes share counts once (proc_pid_smaps(5)).
    """
    groups: dict[int, list[int]] = {root: [] for root in limits}
    for pid in parents:
        ancestor = pid
        while ancestor in parents and ancestor not in groups:
            ancestor = parents[ancestor]
        if ancestor in groups:
            groups[ancestor].append(pid)
    found = {}
    for root, pids in groups.items():
        if _sum(proc, pids, "status", _RESIDENT) > limits[root]:  # quick to read, but counts shared pages twice
            size = _sum(proc, pids, "smaps_rollup", _PROPORTIONAL)
            if size > limits[root]:
                found[root] = size
    return found


def _sum(proc: Path, pids: Iterable[int], file: str, rows: tuple[str, ...]) -> int:
    kilobytes = 0
    for pid in pids:
        with contextlib.suppress(OSError):  # it has ended meanwhile
            for line in (proc / str(pid) / file).read_text(errors="replace").splitlines():
                if line.startswith(rows):
                    kilobytes += int(line.split()[1])
    return kilobytes * 1024
