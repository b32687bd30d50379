"""Which services of the application use more memory than they may."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from dodo_dsl.run.load import process_memory

PERIOD_S = 0.25


def above(limits: Mapping[int, int], parents: Mapping[int, int], proc: Path = process_memory.PROC) -> dict[int, int]:
    """Bytes of memory that a process uses with all that descend from it, of those which use more than their limit.

    ``limits`` are bytes by process id, ``parents`` those of all processes. What processes share counts once.
    """
    groups: dict[int, list[int]] = {root: [] for root in limits}
    for pid in parents:
        ancestor = pid
        while ancestor in parents and ancestor not in groups:
            ancestor = parents[ancestor]
        if ancestor in groups:
            groups[ancestor].append(pid)
    found, memories = {}, process_memory.segments(proc)
    for root, pids in groups.items():
        attached, detached = process_memory.of_service(memories, pids, proc)
        held = process_memory.held(pids, proc) + attached
        if _used(process_memory.resident, proc, pids, held) + detached > limits[root]:
            size = _used(process_memory.proportional, proc, pids, held) + detached
            if size > limits[root]:
                found[root] = size
    return found


def _used(measure: Callable[[int, Path], tuple[int, int]], proc: Path, pids: Iterable[int], held: int) -> int:
    """Bytes of anonymous memory, and of shared memory or of what descriptors hold."""
    anonymous, shared = map(sum, zip(*(measure(pid, proc) for pid in pids), strict=True)) if pids else (0, 0)
    return anonymous + max(shared, held)
