"""Slots on the host: what keeps tests apart by leases where they share the host's namespaces."""

import asyncio
import contextlib
import os
import secrets
import socket
import struct
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator, Sequence

from dodo_dsl.opendlv.address import group
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.process import seccomp_filter
from dodo_dsl.run.process.confinement import MERGED, PROGRAM
from dodo_dsl.run.process.leftovers import end_slot, remove_left, remove_memories
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.deployment import RESERVED_CIDS


def isolation_refusal(on_host: bool = False) -> str:
    """Why applications cannot have their own namespaces, on the host that of processes alone; empty when they can."""
    seen = [word for path in ("/usr", *MERGED) for word in ("--ro-bind-try", path, path)]
    words = [PROGRAM, "--unshare-pid", *([] if on_host else ["--unshare-net", "--unshare-ipc"]), *seen]
    words += ["--proc", "/proc", "--dev", "/dev", "--", "true"]
    try:
        seccomp_filter.program()
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=10)
    except FileNotFoundError:
        return f"there is no program '{PROGRAM}': install bubblewrap"
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if done.returncode == 0:
        return ""
    in_container = "allow this container to make namespaces (docker run --privileged, for example)"
    remedy = "allow user namespaces" if os.getuid() else in_container
    return f"the kernel refuses namespaces ({done.stderr.strip() or f'exit code {done.returncode}'}): {remedy}"


def runs_alone(plan: Plan) -> bool:
    """Whether the application cannot be given another CID or memory name than those built in."""
    services = plan.application.services
    return not any(s.takes_cid for s in services) or not any(s.takes_memory for s in services)


@contextlib.asynccontextmanager
async def host_slot(
    plan: Plan, cids: Sequence[int], say: Callable[[str], None], keep: bool = False, *, alone: bool
) -> AsyncIterator[Slot]:
    """A slot on the host's network: a leased CID without foreign traffic, and a prefix of shared memory.

    With ``alone`` it is the only one on the machine, as an application needs that takes no CID or no memory name.
    With ``keep`` the leases pass on to the sandbox, which holds them until it is taken down. Raises BackendError when
    no slot comes free, or when its CID carries foreign traffic.
    """
    if plan.cid in RESERVED_CIDS:
        raise BackendError(
            f"the application has the CID {plan.cid} built in, which real cars use: on the host's network its tests do "
            "not run; run them without --isolation host"
        )
    name = f"dodo-{secrets.token_hex(4)}-"
    about = {"test": plan.slug, "slot": name}
    held: list[leases.Lease] = []
    try:
        held.append(await leases.lease_any(["machine"], about, say, shared=not alone))
        order = dict.fromkeys((plan.cid, *cids))
        held.append(lease := await leases.lease_any([f"{leases.CID}{cid}" for cid in order], about, say))
        remove_left(lease)
        cid = int(lease.name.removeprefix(leases.CID))
        if foreigner := await asyncio.to_thread(listen, cid):
            raise BackendError(
                f"CID {cid} carries foreign traffic from {foreigner}; end it, or set another range of CIDs"
            )
        yield Slot(cid, name, "" if alone else name, tuple(each.descriptor for each in held))
    finally:
        if not keep:
            await asyncio.shield(asyncio.to_thread(end_slot, name))  # before its leases are released
            remove_memories(name)
        for each in reversed(held):
            each.leave() if keep else each.release()


@contextlib.contextmanager
def joined(cid: int) -> Iterator[socket.socket]:
    """A socket that receives what is sent on a CID's group; raises OSError."""
    bus = group(cid)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        receiver.bind(bus)
        membership = socket.inet_aton(bus[0]) + struct.pack("=I", socket.INADDR_ANY)
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        yield receiver


def listen(cid: int) -> str:
    """The address of the first sender on a CID's group within 0.3 s; empty when nobody sends."""
    try:
        with joined(cid) as receiver:
            receiver.settimeout(0.3)
            _, (address, port) = receiver.recvfrom(65_535)
            return f"{address}:{port}"
    except TimeoutError:
        return ""
    except OSError as error:
        raise BackendError(
            f"multicast does not work on this machine ({error.strerror}); 'dodo doctor' says what to do"
        ) from error
