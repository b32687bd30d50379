"""Memory of processes, as ``/proc`` tells it: without cgroups, which not every machine hands out.

Programs and files that are only read do not count. Files in memory that only a descriptor holds (memfd_create(2)), and
System V memories that processes are attached to, count as shared memory that is mapped does; the larger of both. System
V memories to which no process is attached count beside these.
"""

import contextlib
import os
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

PROC = Path("/proc")
_RESIDENT = (b"RssAnon:", b"RssShmem:")
_PROPORTIONAL = (b"Pss_Anon:", b"Pss_Shmem:")
_MEMFD = "/memfd:"
_BLOCK = 512


class SegmentUse(NamedTuple):
    """A System V memory; ``creator`` is the process that made it, 0 for one of another namespace."""

    creator: int
    size: int
    is_attached: bool


def resident(pid: int, proc: Path = PROC) -> tuple[int, int]:
    """Bytes of anonymous and of shared memory: quick to read, but what processes share counts in each of them."""
    return _rows(f"{proc}/{pid}/status", _RESIDENT)


def proportional(pid: int, proc: Path = PROC) -> tuple[int, int]:
    """The same with the process's part of what it shares (proc_pid_smaps(5)); the kernel looks at every page for it."""
    return _rows(f"{proc}/{pid}/smaps_rollup", _PROPORTIONAL)


def held(pids: Iterable[int], proc: Path = PROC) -> int:
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


def segments(proc: Path = PROC) -> list[SegmentUse]:
    """The System V memories of this process's IPC namespace, with bytes in memory and swap (proc_pid_sysvipc(5))."""
    with contextlib.suppress(OSError):
        with open(f"{proc}/sysvipc/shm", "rb", buffering=0) as file:  # noqa: PTH123
            names, *rows = [line.split() for line in file.readall().splitlines()]
        creator, attached, resident_, swapped = (names.index(name) for name in (b"cpid", b"nattch", b"rss", b"swap"))
        return [SegmentUse(int(r[creator]), int(r[resident_]) + int(r[swapped]), int(r[attached]) > 0) for r in rows]
    return []


def of_service(found: Iterable[SegmentUse], pids: Collection[int], proc: Path = PROC) -> tuple[int, int]:
    """Bytes of System V memories of a service: those with processes attached, and others.

    They are of the service whose process created them. Where the creator has ended, they are of every service, if this
    process is the first of its namespaces: elsewhere they may be of anybody.
    """
    attached = detached = 0
    for creator, size, is_attached in found:
        is_orphan = creator > 0 and os.getpid() == 1 and not os.path.exists(f"{proc}/{creator}")  # noqa: PTH110
        if creator in pids or is_orphan:
            attached, detached = attached + size * is_attached, detached + size * (not is_attached)
    return attached, detached


def _rows(path: str, rows: tuple[bytes, bytes]) -> tuple[int, int]:
    """Two rows of a file, in bytes; nothing of a process that has ended. It is read many times a second."""
    try:
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123
            text = file.read()
    except OSError:
        return 0, 0
    first, second = (_kilobytes(text, row) * 1024 for row in rows)
    return first, second


def _kilobytes(text: bytes, row: bytes) -> int:
    at = text.find(b"\n" + row)
    return int(text[at + 1 + len(row) :].split(None, 1)[0]) if at >= 0 else 0
