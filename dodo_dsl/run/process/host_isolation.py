"""Slots on the host: what keeps tests apart by leases where they share the host's namespaces."""

import asyncio
import contextlib
import os
import secrets
import shutil
import socket
import struct
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dodo_dsl.opendlv.address import group
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.process import leftovers
from dodo_dsl.run.process.confinement import INTERPRETER, MOST_TRIES, MOUNT_GONE, PROGRAM, Confinement
from dodo_dsl.run.process.fork_server_client import ForkServer
from dodo_dsl.run.process.leftovers import end_slot, remove_memories
from dodo_dsl.run.process.sandbox_client import SandboxClient
from dodo_dsl.run.process.slot import Entered, Slot
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.deployment import RESERVED_CIDS

PROBE_S = 0.3


@dataclass(frozen=True)
class IsolationRefusal:
    """Why applications cannot be isolated, and what to do about it; ``remedy`` is empty where nothing is known."""

    why: str
    remedy: str = ""


async def isolation_refusal(fork_server: ForkServer | None = None) -> IsolationRefusal | None:
    """Why tests and applications cannot have their own namespaces on this machine; None when they can.

    What is missing is found by a trial: a program that does nothing is an application.
    """
    ended: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()

    def take(message: dict[str, Any]) -> None:
        if "started" not in message and not ended.done():
            ended.set_result(message)

    client = SandboxClient(take, lambda why: take({"why": why}), fork_server)
    with os.fdopen(os.memfd_create("output"), "w+b") as output:
        try:
            await client.open(Slot(0), output.fileno(), Entered.with_own(0))
        except BackendError as error:
            if fork_server is not None and not fork_server.is_alive:
                return IsolationRefusal(f"{error}, with the process that starts it")
            in_container = "allow this container to make namespaces (docker run --privileged, for example)"
            remedy = "allow user namespaces" if os.getuid() else in_container
            return IsolationRefusal(f"the kernel refuses namespaces: {error}", remedy)
        words = {"id": "true", "argv": ["true"], "env": {"PATH": os.defpath}, "cwd": "/", "fork": False, "masked": ()}
        client.start({**words, "confined": asdict(Confinement("/usr", INTERPRETER))}, output.fileno())
        answer = await ended
        await client.close()
        output.seek(0)
        said = output.read(1000).decode(errors="replace").strip()
    if answer.get("code") == 0:
        return None
    if shutil.which(PROGRAM) is None:
        return IsolationRefusal(f"there is no program '{PROGRAM}'", "install bubblewrap")
    why = answer.get("why") or said or f"exit code {answer.get('code')}"
    return IsolationRefusal(f"a trial, to run 'true' in a sandbox as applications have it, ended with: {why}")


def process_namespace_refusal() -> str:
    """Why an application on the host cannot have its own process namespace; empty when it can."""
    words = [PROGRAM, "--unshare-pid", "--dev-bind", "/", "/", "--proc", "/proc", "--", "true"]
    for _ in range(MOST_TRIES):
        try:
            done = subprocess.run(
                words, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, timeout=10
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return str(error)
        if not MOUNT_GONE.match(done.stderr):
            break
    return "" if done.returncode == 0 else done.stderr.strip() or f"exit code {done.returncode}"


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
    claims: list[socket.socket] = []

    def attempt(name: str, about: dict[str, Any], shared: bool) -> leases.Lease | None:
        if lease := leases.try_lease(name, about, shared):
            if claim := _claimed(name):
                claims.append(claim)
                return lease
            lease.release()
        return None

    try:
        turn = await leases.lease_any(["turn"], about, say)  # who waits for the machine alone has it next
        try:
            held.append(await leases.lease_any(["machine"], about, say, shared=not alone))
        finally:
            turn.release()
        order = [plan.cid, *(c for c in cids if c != plan.cid)]
        lease = await leases.lease_any([f"{leases.CID}{c}" for c in order], about, say, attempt=attempt)
        held.append(lease)
        leftovers.remove_left(lease)
        cid = int(lease.name.removeprefix(leases.CID))
        foreigner = await asyncio.get_running_loop().run_in_executor(None, listen, cid)
        if foreigner:
            raise BackendError(
                f"CID {cid} carries foreign traffic from {foreigner}; end it, or set another range of CIDs"
            )
        descriptors = *(held_lease.descriptor for held_lease in held), *(claim.fileno() for claim in claims)
        yield Slot(cid, name, "" if alone else name, descriptors)
    finally:
        if not keep:
            await asyncio.shield(asyncio.to_thread(end_slot, name))  # before its leases are released
        for held_lease in reversed(held):
            held_lease.leave() if keep else held_lease.release()
        for claim in claims:
            claim.close()
        if not keep:
            remove_memories(name)


def _claimed(name: str) -> socket.socket | None:
    """Holds a lease's name in this network, of which all users and all lease folders are part; None if it is held.

    An abstract name (unix(7)) lives as long as a process that holds its socket, and is one of a network namespace, as
    the bus is that it stands for.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0dodo-{name}")
    except OSError:
        claim.close()
        return None
    return claim


def is_claimed(name: str) -> bool:
    """Whether a program in this network holds a lease's name."""
    if claim := _claimed(name):
        claim.close()
    return claim is None


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


def listen(cid: int, seconds: float = PROBE_S) -> str:
    """The address of the first sender on a CID's group within ``seconds``; empty when nobody sends."""
    try:
        with joined(cid) as receiver:
            receiver.settimeout(seconds)
            _, (address, port) = receiver.recvfrom(65_535)
            return f"{address}:{port}"
    except TimeoutError:
        return ""
    except OSError as error:
        raise BackendError(
            f"multicast does not work on this machine ({error.strerror}); 'dodo doctor' says what to do"
        ) from error
