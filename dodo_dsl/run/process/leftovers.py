"""What tests leave on the host, and its removal: processes and shared memory by the name of their slot."""

import contextlib
import os
import re
import select
import shutil
import signal
import time
from pathlib import Path

from dodo_dsl.run import application_time, leases
from dodo_dsl.run.process import process_group
from dodo_dsl.run.process.slot import SLOT_VARIABLE

SLOT_NAME = re.compile(r"dodo-[0-9a-f]{8}-")
_END_S, _KILL_S = 3.0, 2.0


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
    if ended := _signal_slot(slot, signal.SIGTERM, _END_S):
        _signal_slot(slot, signal.SIGKILL, _KILL_S)
    return ended


def _signal_slot(slot: str, number: signal.Signals, patience: float) -> int:
    """How many processes got a signal; returns when all of them have ended, at the latest after ``patience`` in s."""
    mark = f"{SLOT_VARIABLE}={slot}\0".encode()
    with contextlib.ExitStack() as stack:
        running = set()
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != os.getpid():
                with contextlib.suppress(OSError):
                    if mark in (entry / "environ").read_bytes() + b"\0":
                        descriptor = os.pidfd_open(int(entry.name))
                        stack.callback(os.close, descriptor)
                        signal.pidfd_send_signal(descriptor, number)
                        running.add(descriptor)
        notified, deadline = len(running), time.monotonic() + patience
        while running and (left := deadline - time.monotonic()) > 0:
            running -= set(select.select(running, [], [], left)[0])
    return notified


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
