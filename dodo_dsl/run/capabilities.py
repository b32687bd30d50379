"""What this machine offers to tests, by its kernel and programs, and the removal of what killed runs left."""

import contextlib
import os
import re
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dodo_dsl import advice, package_data
from dodo_dsl.opendlv.address import group
from dodo_dsl.run import leases
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.client import NoEngine, connect
from dodo_dsl.run.process import host_isolation, leftovers
from dodo_dsl.run.rigs.leases import all_quarantined
from dodo_dsl.run.rigs.problems import RigProblem


@dataclass(frozen=True)
class Capability:
    """One thing that was examined; ``advice`` is what to do when it is not ok."""

    name: str
    state: Literal["ok", "warning", "problem"]
    text: str
    advice: str = ""


def namespaces() -> Iterator[Capability]:
    if why := host_isolation.isolation_refusal():
        way = "for applications you trust, --isolation host"
        yield Capability("namespaces", "problem", f"an application cannot be isolated: {why}", way)
    else:
        yield Capability("namespaces", "ok", "each test gets its own network, IPC and /tmp, its application a sandbox")


def multicast() -> Iterator[Capability]:
    try:
        with host_isolation.joined(254) as receiver, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            receiver.settimeout(1.0)
            sender.sendto(b"dodo", group(254))
            receiver.recv(65_535)
        yield Capability("multicast", "ok", "works on the host")
    except OSError as error:
        way = "as root: ip link set lo up multicast on && ip route replace 225.0.0.0/24 dev lo"
        text = f"does not work on the host ({error}); 'isolation: host' needs it"
        yield Capability("multicast", "problem", text, way)


def docker_engine() -> Iterator[Capability]:
    try:
        with contextlib.closing(connect()) as client:
            version = client.version()
    except NoEngine as error:
        text = f"none answers ({error.reason}); --backend docker and mixed need one"
        yield Capability("docker engine", "warning", text, error.way)
    else:
        where = f" at {host}" if (host := os.environ.get("DOCKER_HOST")) else ""
        text = f"version {version.get('Version')}, API {version.get('ApiVersion')}{where}"
        yield Capability("docker engine", "ok", text)


def compose() -> Iterator[Capability]:
    command, text = ["docker", "compose", "version", "--short"], ""
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    if [int(number) for number in re.findall(r"\d+", text)[:2]] >= [2, 20]:
        yield Capability("compose", "ok", f"version {text}")
        return
    found = f"version {text} is older than 2.20" if text else "'docker compose' does not run"
    yield Capability("compose", "warning", f"{found}; --backend docker and mixed need it", advice.DOCKER)


FIRMWARE = "DODO_FIRMWARE"
EMULATOR_PLACES = (package_data.root() / "build" / "firmware", Path("/opt/dodo/firmware"))


def emulated_rig() -> Iterator[Capability]:
    """Whether the programs are built that a gantry with ``--serial=emulated`` starts."""
    named = os.environ.get(FIRMWARE)
    places = (Path(named),) if named else EMULATOR_PLACES
    built = [p for p in places if all((p / name).is_file() for name in ("rig-emulator", "gantry.elf"))]
    if built:
        yield Capability("emulated rig", "ok", f"is built, in {built[0]}")
    else:
        text = f"is not built: it is not in {' or '.join(map(str, places))}; hil tests need it"
        yield Capability("emulated rig", "warning", text, advice.FIRMWARE)


def left_behind() -> Iterator[Capability]:
    left = []
    for lease in (lease for prefix in (leases.CID, leases.PROJECT) for lease in leases.orphans(prefix)):
        left.append(f"test {lease.left.get('test', '?')}")
        lease.leave()
    if left:
        yield Capability("left behind", "warning", f"by killed runs: {', '.join(left)}", "dodo doctor --clean")
    else:
        yield Capability("left behind", "ok", "nothing of killed runs")


def rigs() -> Iterator[Capability]:
    try:
        for rig, why in all_quarantined().items():
            way = f"repair it, then dodo rig clear {rig}"
            yield Capability(f"rig {rig}", "problem", f"in quarantine: {why}", way)
    except RigProblem as problem:
        yield Capability("rigs", "warning", str(problem), "tests on real rigs end in error without it")


def examine() -> Iterator[Capability]:
    """All findings, in the order in which a run would need things; a check that raises is one, too."""
    for check in (namespaces, multicast, docker_engine, compose, left_behind, rigs, emulated_rig):
        try:
            yield from check()
        except Exception as error:  # noqa: BLE001  (a machine that lacks something is what this command is for)
            yield Capability(check.__name__.replace("_", " "), "problem", f"cannot be examined: {error}")


def clean() -> tuple[list[str], list[str]]:
    """Removes what killed runs left, as the next run would; returns what was removed, and what could not be."""
    removed, left = leftovers.reap(), list[str]()
    with contextlib.suppress(NoEngine), contextlib.closing(connect()) as client:
        of_engine, left = cleanup.reap_projects(client)
        removed += of_engine
    return removed, left
