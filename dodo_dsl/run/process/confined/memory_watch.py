"""Memory of the application's services, as ``/proc`` tells it: without cgroups, which not every machine hands out."""

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path

PERIOD_S = 0.25
_COUNTED = ("RssAnon:", "RssShmem:")


def used(roots: Iterable[int], parents: Mapping[int, int], proc: Path = Path("/proc")) -> dict[int, int]:
    """Bytes of memory that each root uses with all that descend from it; ``parents`` are those of all processes.

    What processes share counts once for each, but programs and files that they only read do not.
    """
    wanted = set(roots)
    sums = dict.fromkeys(wanted, 0)
    for pid in parents:
        ancestor = pid
        while ancestor in parents and ancestor not in wanted:
            ancestor = parents[ancestor]
        if ancestor in wanted:
            sums[ancestor] += resident(proc / str(pid))
    return sums


def resident(process: Path) -> int:
    """Bytes of a process in memory, without pages of files; 0 when it has ended."""
    kilobytes = 0
    with contextlib.suppress(OSError):
        for line in (process / "status").read_text(errors="replace").splitlines():
            if line.startswith(_COUNTED):
                kilobytes += int(line.split()[1])
    return kilobytes * 1024
