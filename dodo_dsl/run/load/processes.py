"""The processes that ``/proc`` shows, and which descend from which."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path


def parents(proc: Path = Path("/proc")) -> Iterator[tuple[int, int]]:
    """The pids of every process that is not a zombie and of its parent."""
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                if fields[0] != "Z":
                    yield int(entry.name), int(fields[1])


def owners(services: Mapping[int, str], proc: Path = Path("/proc")) -> Iterator[tuple[int, str]]:
    """The pids of the processes of ``services``, which are pids and names, and of what they started, with the name."""
    known = dict(parents(proc))
    for pid in known:
        ancestor = pid
        while ancestor in known and ancestor not in services:
            ancestor = known[ancestor]
        if ancestor in services:
            yield pid, services[ancestor]
