"""Memory of the application's services, as ``/proc`` tells it: without cgroups, which not every machine hands out."""

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path

PERIOD_S = 0.25
_RESIDENT = ("RssAnon:", "RssShmem:")
_PROPORTIONAL = ("Pss_Anon:", "Pss_Shmem:")
_MEMFD = "/memfd:"
_BLOCK = 512


def above(limits: Mapping[int, int], parents: Mapping[int, int], proc: Path = Path("/proc")) -> dict[int, int]:
    """Bytes of memory that a process uses with all that descend from it, of those which use more than their limit.

    ``limits`` are bytes by process id, ``parents`` those of all processes. Programs and files that are only read do not
    count, and what processes share counts once (proc_pid_smaps(5)). Files in memory that only a descriptor holds
    (memfd_create(2)) count as shared memory that is mapped does; the larger of both.
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
        held = _held(proc, pids)
        if _used(proc, pids, "status", _RESIDENT, held) > limits[root]:  # quick to read, but counts shared pages twice
            size = _used(proc, pids, "smaps_rollup", _PROPORTIONAL, held)
            if size > limits[root]:
                found[root] = size
    return found


def _used(proc: Path, pids: Iterable[int], file: str, rows: tuple[str, str], held: int) -> int:
    """Bytes of anonymous memory, and of shared memory or of what descriptors hold."""
    kilobytes = dict.fromkeys(rows, 0)
    for pid in pids:
        with contextlib.suppress(OSError):  # it has ended meanwhile
            for line in (proc / str(pid) / file).read_text(errors="replace").splitlines():
                name, *words = line.split()
                if name in kilobytes:
                    kilobytes[name] += int(words[0])
    anonymous, shared = (kilobytes[row] * 1024 for row in rows)
    return anonymous + max(shared, held)


def _held(proc: Path, pids: Iterable[int]) -> int:
    """Bytes of the files in memory of which these processes have descriptors, each once."""
    sizes: dict[tuple[int, int], int] = {}
    for pid in pids:
        with contextlib.suppress(OSError):  # it has ended meanwhile
            for entry in (proc / str(pid) / "fd").iterdir():
                with contextlib.suppress(OSError):
                    if str(entry.readlink()).startswith(_MEMFD):
                        about = entry.stat()
                        sizes[about.st_dev, about.st_ino] = about.st_blocks * _BLOCK
    return sum(sizes.values())
