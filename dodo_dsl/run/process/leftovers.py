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
_END_S, _KILL_S = 3.0, 2.0


def reap() -> list[str]:
    """Removes what killed runs left on the host, by leases that nobody holds; returns a phrase for each test."""
    removed = []
    leases.forget_dead()
    process_group.remove_unused()
    for lease, about in leases.orphans("cid-"):
        slot = str(about.get("slot", ""))
        if SLOT_NAME.fullmatch(slot):
            killed = end_slot(slot)
            memories = remove_memories(slot)
            if killed or memories:
                removed.append(f"{about.get('test', '?')}: {killed} processes and {memories} shared memories")
        lease.release()
    return removed


def end_slot(slot: str) -> int:
    """Ends the processes whose environment names the slot, which may be moving a rig; returns their number."""
    ended = _signal_slot(slot, signal.SIGTERM)
    _wait_for(ended, _END_S)
    _wait_for(_signal_slot(slot, signal.SIGKILL) if ended else [], _KILL_S)
    return len(ended)


def _signal_slot(slot: str, number: signal.Signals) -> list[Path]:
    mark = f"{SLOT_VARIABLE}={slot}\0".encode()
    notified: list[Path] = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with contextlib.suppress(OSError):
                if mark in (entry / "environ").read_bytes() + b"\0":
                    os.kill(int(entry.name), number)
                    notified.append(entry)
    return notified


def _wait_for(processes: list[Path], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while any(_is_alive(entry) for entry in processes) and time.monotonic() < deadline:
        time.sleep(0.01)


def _is_alive(process: Path) -> bool:
    """Whether a process still runs: a zombie does not."""
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


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
