"""Lanes: how tests of the process backend are kept apart, by namespaces where the kernel allows, else by leases."""

import asyncio
import contextlib
import os
import re
import secrets
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.process.backend import Lane
from dodo_dsl.run.protocol import BackendError

PROBE_S = 0.3
LANE = re.compile(r"dodo-[0-9a-f]{8}-")
_PORT = 12175
_END_S, _KILL_S = 3.0, 2.0


def namespaces_refusal() -> str:
    """Why tests cannot have namespaces of their own here; empty when they can."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        argv = [sys.executable, "-P", "-m", "dodo_dsl.run.process.sandbox", str(theirs.fileno()), "network"]
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])}
        process = subprocess.Popen(argv, pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL, env=environment)
        theirs.close()
        answer = ours.recv(4096)
        ours.close()
        process.wait()
    if b'"up"' in answer:
        return ""
    return answer.decode().partition('"down": "')[2].rstrip('"}') or "the kernel refused"


def runs_alone(plan: Plan) -> bool:
    """Whether the application cannot be told another CID or memory than those built in."""
    services = plan.application.services
    return not any(s.takes_cid for s in services) or not any(s.takes_memory for s in services)


@contextlib.asynccontextmanager
async def host_lane(
    plan: Plan, cids: Sequence[int], say: Callable[[str], None], keep: bool = False, *, alone: bool
) -> AsyncIterator[Lane]:
    """A lane on the host's network: a leased CID that nobody else talks on, and a prefix of shared memory.

    With ``alone`` it is the only one on the machine, as an application needs that takes no CID or no memory name.
    With ``keep`` the leases pass on to the sandbox, which holds them until it is taken down. Raises BackendError when
    no slot comes free, or when its only CID carries foreign traffic.
    """
    name = f"dodo-{secrets.token_hex(4)}-"
    about = {"test": plan.slug, "lane": name}
    held: list[leases.Lease] = []
    try:
        held.append(await leases.lease_any(["machine"], about, say, shared=not alone))
        order = [plan.cid, *(c for c in cids if c != plan.cid)]
        lease = await leases.lease_any([f"cid-{c}" for c in order], about, say)
        held.append(lease)
        cid = int(lease.name.removeprefix("cid-"))
        foreigner = await asyncio.get_running_loop().run_in_executor(None, listen, cid)
        if foreigner:
            raise BackendError(f"CID {cid} carries foreign traffic from {foreigner}; end it or give another range")
        yield Lane(cid, name, "" if alone else name, tuple(held_lease.descriptor for held_lease in held))
    except leases.LeaseTimeout as error:
        raise BackendError(str(error)) from error
    finally:
        if not keep:
            await asyncio.shield(asyncio.to_thread(end_lane, name))  # what outlived its sandbox ends before its lease
        for held_lease in reversed(held):
            held_lease.leave() if keep else held_lease.release()
        if not keep:
            remove_memories(name)


def listen(cid: int, seconds: float = PROBE_S) -> str:
    """The address of whoever sends on a CID's group within a while, or nothing."""
    group = f"225.0.0.{cid}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            receiver.bind((group, _PORT))
            membership = socket.inet_aton(group) + struct.pack("=I", socket.INADDR_ANY)
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError as error:
            raise BackendError(f"this machine carries no multicast ({error.strerror}); see the README") from error
        receiver.settimeout(seconds)
        try:
            _, (address, port) = receiver.recvfrom(65_535)
        except TimeoutError:
            return ""
        return f"{address}:{port}"


def reap() -> list[str]:
    """Removes what killed runs left on the host: processes and shared memory of leases that nobody holds."""
    removed = []
    leases.forget_dead()
    for lease, about in leases.orphans("cid-"):
        lane = str(about.get("lane", ""))
        if LANE.fullmatch(lane):
            killed = end_lane(lane)
            memories = remove_memories(lane)
            if killed or memories:
                removed.append(f"{about.get('test', '?')}: {killed} processes and {memories} shared memories")
        lease.release()
    return removed


def end_lane(lane: str) -> int:
    """Ends the processes whose environment names the lane, which may be moving a rig; says how many there were."""
    ended = _signal_lane(lane, signal.SIGTERM)
    _wait_for(ended, _END_S)
    _wait_for(_signal_lane(lane, signal.SIGKILL) if ended else [], _KILL_S)
    return len(ended)


def _signal_lane(lane: str, number: signal.Signals) -> list[Path]:
    mark = f"DODO_LANE={lane}\0".encode()
    told: list[Path] = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with contextlib.suppress(OSError):
                if mark in (entry / "environ").read_bytes() + b"\0":
                    os.kill(int(entry.name), number)
                    told.append(entry)
    return told


def _wait_for(processes: list[Path], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while any(_lives(entry) for entry in processes) and time.monotonic() < deadline:
        time.sleep(0.01)


def _lives(process: Path) -> bool:
    """Whether a process still holds anything: a zombie does not."""
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def remove_memories(prefix: str) -> int:
    """Removes shared memories by the prefix of their names, with their semaphores; says how many there were."""
    from dodo_dsl.opendlv.memory.shared_memory import SharedMemory, SharedMemoryError

    removed = 0
    for token in [p for p in Path("/tmp").glob(f"{prefix}*") if p.is_file() and not p.is_symlink()]:
        if token.name.startswith(f"{prefix}ready-"):
            token.unlink(missing_ok=True)
            continue
        with contextlib.suppress(SharedMemoryError):
            SharedMemory.create(token.name, 1).close()  # a creator removes what a dead one left
            removed += 1
    return removed
