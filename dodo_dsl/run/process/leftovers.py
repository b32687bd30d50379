"""What tests leave on the host, and its removal: processes and shared memory by the name of their slot."""

import contextlib
import os
import re
import shutil
import signal
import time
from pathlib import Path

from dodo_dsl.run import application_time, leases
from dodo_dsl.run.process import process_group
from dodo_dsl.run.process.slot import SLOT_VARIABLE

SLOT_NAME = re.compile(r"dodo-[0-9a-f]{8}-")
_END_S, _KILL_S, _POLL_S = 3.0, 2.0, 0.05


def reap() -> list[str]:
    """Removes what killed runs left on the host, by leases that nobody holds; returns a phrase for each test."""
    removed = []
    process_group.remove_unused()
    for lease in leases.orphans(leases.CID):
        killed, memories = remove_left(lease)
        if killed or memories:
            removed.append(f"{lease.left.get('test', '?')}: {killed} processes and {memories} shared memories")
        lease.release()
    return removed


def remove_left(lease: leases.Lease) -> tuple[int, int]:
    """Ends what a dead holder of a CID has left; the numbers of processes and shared memories."""
    slot = str(lease.left.get("slot", ""))
    return (end_slot(slot), remove_memories(slot)) if SLOT_NAME.fullmatch(slot) else (0, 0)


def end_slot(slot: str) -> int:
    """Ends the processes whose environment names the slot, which may be moving a rig; returns their number."""
    ended = len(running := _of_slot(slot))
    for number, patience_s in ((signal.SIGTERM, _END_S), (signal.SIGKILL, _KILL_S)):
        deadline = time.monotonic() + patience_s
        for pid in running:
            with contextlib.suppress(OSError):
                os.kill(pid, number)
        while (running := _of_slot(slot)) and time.monotonic() < deadline:
            time.sleep(_POLL_S)
    return ended


def _of_slot(slot: str) -> list[int]:
    """Processes that have not ended."""
    mark, found = f"{SLOT_VARIABLE}={slot}\0".encode(), []
    for entry in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in entry.read_bytes() + b"\0" and int(entry.parent.name) != os.getpid():
                found.append(int(entry.parent.name))
    return found


def remove_memories(prefix: str) -> int:
    """Removes shared memories by the prefix of their names, with their semaphores; returns their number."""
    from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError

    removed = 0
    if SLOT_NAME.fullmatch(prefix):
        shutil.rmtree(application_time.folder_of(prefix), ignore_errors=True)
    for token in [p for p in Path("/tmp").glob(f"{prefix}*") if p.is_file() and not p.is_symlink()]:
        with contextlib.suppress(SharedMemoryError):
            SharedMemory.create(token.name, 1).close()  # creating replaces what a dead creator left
            removed += 1
    return removed
