"""Memory of processes, as ``/proc`` tells it: without cgroups, which not every machine hands out.

Programs and files that are only read do not count. Files in memory that only a descriptor holds (memfd_create(2)) count
as shared memory that is mapped does; the larger of both.
"""

import contextlib
from collections.abc import Iterable
from pathlib import Path

PROC = Path("/proc")
_RESIDENT = (b"RssAnon:", b"RssShmem:")
_PROPORTIONAL = (b"Pss_Anon:", b"Pss_Shmem:")
_MEMFD = "/memfd:"
_BLOCK = 512


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
