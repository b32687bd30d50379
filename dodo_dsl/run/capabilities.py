"""What this machine offers to tests, by its kernel and programs, and the removal of what killed runs left.

Programs are those that some tests need: a Docker engine, Compose, and the emulator of the rig's firmware.
"""

import contextlib
import errno
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dodo_dsl import advice, package_data
from dodo_dsl.opendlv.address import group
from dodo_dsl.run import leases
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.client import NoEngine, connect
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.leases import all_quarantined
from dodo_dsl.run.rigs.problems import RigProblem

State = Literal["ok", "warning", "problem"]


@dataclass(frozen=True)
class Capability:
    """One thing that was examined; ``advice`` is what to do when it is not ok."""

    name: str
    state: State
    text: str
    advice: str = ""


_RECEIVE_S = 1.0
_CID = 254
_BUSES = "225.0.0.0/24"
"""The groups of all sessions."""
_NO_ROUTE = (errno.ENETUNREACH, errno.ENODEV, errno.EADDRNOTAVAIL)


def namespaces() -> Iterator[Capability]:
    """Whether tests can have their own namespaces."""
    if why := host_isolation.isolation_refusal():
        way = "for applications you trust, --isolation host"
        yield Capability("namespaces", "problem", f"an application cannot be isolated: {why}", way)
    else:
        yield Capability("namespaces", "ok", "each test gets its own network, IPC and /tmp, its application a sandbox")


def multicast() -> Iterator[Capability]:
    """Whether a datagram to a multicast group is received."""
    mark = os.urandom(16)
    try:
        with host_isolation.joined(_CID) as receiver, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            receiver.settimeout(_RECEIVE_S)
            sender.sendto(mark, group(_CID))
            deadline = time.monotonic() + _RECEIVE_S
            while receiver.recv(65_535) != mark:
                if time.monotonic() > deadline:
                    raise TimeoutError("only other datagrams were received")
    except OSError as error:
        no_route = isinstance(error, TimeoutError) or error.errno in _NO_ROUTE
        way = advice.as_root("ip link set lo up multicast on", f"ip route replace {_BUSES} dev lo") if no_route else ""
        yield Capability(
            "multicast", "problem", f"does not work on the host ({error}); 'isolation: host' needs it", way
        )
    else:
        yield Capability("multicast", "ok", "works on the host")


FIRMWARE = "DODO_FIRMWARE"
EMULATOR_PLACES = (package_data.root() / "build" / "firmware", Path("/opt/dodo/firmware"))
_COMPOSE = (2, 20)


def docker_engine() -> Iterator[Capability]:
    """Whether a Docker engine answers."""
    try:
        client = connect()
    except NoEngine as error:
        text = f"none answers ({error.reason}); --backend docker and mixed need one"
        yield Capability("docker engine", "warning", text, error.way)
        return
    with contextlib.closing(client):
        version = client.version()
        where = f" at {host}" if (host := os.environ.get("DOCKER_HOST")) else ""
        tls = " with TLS" if client.api.base_url.startswith("https:") else ""
        text = f"version {version.get('Version')}, API {version.get('ApiVersion')}{where}{tls}"
        yield Capability("docker engine", "ok", text)


def compose_plugin() -> Iterator[Capability]:
    """Whether there is Compose of a version that DoDo supports."""
    command = ["docker", "compose", "version", "--short"]
    try:
        text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        text = ""
    numbers = tuple(int(n) for n in text.lstrip("v").split("-")[0].split(".")[:2] if n.isdecimal())
    if numbers >= _COMPOSE:
        yield Capability("compose", "ok", f"version {text}")
        return
    found = f"version {text} is older than 2.20" if numbers else "'docker compose' does not run"
    way = advice.docker_plugin("compose") if shutil.which("docker") else advice.docker()
    yield Capability("compose", "warning", f"{found}; --backend docker and mixed need it", way)


def emulator_folder() -> Path | None:
    """Where the emulated rig is built; None if it is not."""
    return next((p for p in _places() if all((p / name).is_file() for name in ("rig-emulator", "gantry.elf"))), None)


def _places() -> tuple[Path, ...]:
    named = os.environ.get(FIRMWARE)
    return (Path(named),) if named else EMULATOR_PLACES


def emulated_rig() -> Iterator[Capability]:
    """Whether the programs are built that a gantry with ``--serial=emulated`` starts."""
    places = _places()
    if found := emulator_folder():
        yield Capability("emulated rig", "ok", f"is built, in {found}")
    else:
        text = f"is not built: it is not in {' or '.join(map(str, places))}; hil tests need it"
        yield Capability("emulated rig", "warning", text, advice.firmware(FIRMWARE))


def examine() -> list[Capability]:
    """All findings, in the order in which a run would need things."""
    return [finding for check in CHECKS for finding in _findings(check)]


def _findings(check: Callable[[], Iterator[Capability]]) -> Iterator[Capability]:
    """The findings of a check; a check that raises is a finding, too."""
    try:
        yield from check()
    except Exception as error:  # noqa: BLE001  (a machine that lacks something is what this command is for)
        yield Capability(check.__name__.replace("_", " "), "problem", f"cannot be examined: {error}")


def left_behind() -> Iterator[Capability]:
    """What killed runs left."""
    left = []
    for lease in (lease for prefix in (leases.CID, leases.PROJECT) for lease in leases.orphans(prefix)):
        left.append(f"test {lease.left.get('test', '?')}")
        lease.leave()
    if left:
        yield Capability("left behind", "warning", f"by killed runs: {', '.join(left)}", "dodo doctor --clean")
    else:
        yield Capability("left behind", "ok", "nothing of killed runs")


def rigs() -> Iterator[Capability]:
    """The rigs in quarantine."""
    try:
        for rig, reason in all_quarantined().items():
            yield Capability(
                f"rig {rig}", "problem", f"in quarantine: {reason}", f"repair it, then dodo rig clear {rig}"
            )
    except RigProblem as problem:
        yield Capability("rigs", "warning", str(problem), "tests on real rigs end in error without it")


CHECKS: tuple[Callable[[], Iterator[Capability]], ...] = (
    namespaces,
    multicast,
    docker_engine,
    compose_plugin,
    left_behind,
    rigs,
    emulated_rig,
)


def clean() -> cleanup.Reaped:
    """Removes what killed runs left, as the next run would; returns what was removed, and what could not be."""
    on_host = leftovers.reap()
    try:
        client = connect()
    except BackendError:
        return cleanup.Reaped(on_host)
    with contextlib.closing(client):
        reaped = cleanup.reap_projects(client)
    return cleanup.Reaped([*on_host, *reaped.removed], reaped.left)
