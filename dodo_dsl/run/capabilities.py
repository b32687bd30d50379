"""What this machine can run and what it lacks, each with what to do about it."""

import contextlib
import os
import shutil
import socket
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dodo_dsl import package_data
from dodo_dsl.run import leases
from dodo_dsl.run.docker import cleanup
from dodo_dsl.run.docker.client import connect
from dodo_dsl.run.process import host_isolation
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs import rigs

State = Literal["ok", "warning", "problem"]

FIRMWARE = "DODO_FIRMWARE"
EMULATOR_PLACES = (package_data.root() / "build" / "firmware", Path("/opt/dodo/firmware"))
_PORT = 12175
_RECEIVE_BUFFER = 26_214_400
_COMPOSE = (2, 20)
_HEARD_S = 1.0
_FREE_BYTES = 2 << 30
_SEGMENTS = 64
_SEGMENT_BYTES = 64 << 20


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; ``advice`` is what to do when it is not ok."""

    name: str
    state: State
    text: str
    advice: str = ""


def examine() -> list[Finding]:
    """All findings, in the order in which a run would need things."""
    return [finding for check in CHECKS for finding in _looked(check)]


def _looked(check: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """What a check finds; one that cannot be made is a finding, too."""
    try:
        yield from check()
    except Exception as error:  # noqa: BLE001  (a machine that lacks something is what this command is for)
        name = check.__name__.strip("_").replace("_", " ")
        yield Finding(name, "problem", f"cannot be looked at: {error}")


def _namespaces() -> Iterator[Finding]:
    refusal = host_isolation.namespaces_refusal()
    if refusal:
        advice = "tests run on the host with leases; for isolation allow user namespaces or run as root"
        yield Finding("namespaces", "warning", f"the kernel refuses them: {refusal}", advice)
    else:
        yield Finding("namespaces", "ok", "each test of the process backend gets network, IPC and /tmp of its own")


def _multicast() -> Iterator[Finding]:
    """A datagram to an own group, heard again."""
    group, mark = "225.0.0.254", os.urandom(16)
    membership = socket.inet_aton(group) + struct.pack("=I", socket.INADDR_ANY)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind((group, _PORT))
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            receiver.settimeout(_HEARD_S)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.sendto(mark, (group, _PORT))
            deadline = time.monotonic() + _HEARD_S
            while receiver.recv(65_535) != mark:
                if time.monotonic() > deadline:
                    raise TimeoutError("only others are heard")
    except OSError as error:
        advice = "sudo ip link set lo multicast on; sudo ip route add 224.0.0.0/4 dev lo"
        yield Finding("multicast", "problem", f"the host carries none ({error}); isolation: host needs it", advice)
    else:
        yield Finding("multicast", "ok", "the host carries it")


def _receive_buffer() -> Iterator[Finding]:
    limit = _number("/proc/sys/net/core/rmem_max")
    if limit < _RECEIVE_BUFFER:
        advice = f"sudo sysctl -w net.core.rmem_max={_RECEIVE_BUFFER}"
        text = f"sockets may hold {limit:,} bytes, OpenDLV asks for {_RECEIVE_BUFFER:,}: bursts may be lost"
        yield Finding("receive buffer", "warning", text, advice)
    else:
        yield Finding("receive buffer", "ok", f"sockets may hold {limit:,} bytes")


def _shared_memory() -> Iterator[Finding]:
    segments, size = _number("/proc/sys/kernel/shmmni"), _number("/proc/sys/kernel/shmmax")
    if segments < _SEGMENTS or size < _SEGMENT_BYTES:
        advice = f"sudo sysctl -w kernel.shmmni=4096 kernel.shmmax={_SEGMENT_BYTES * 16}"
        yield Finding("shared memory", "problem", f"only {segments} segments of {size:,} bytes", advice)
    else:
        yield Finding("shared memory", "ok", f"{segments:,} segments are allowed")


def _number(path: str) -> int:
    try:
        return int(Path(path).read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0


def _disk() -> Iterator[Finding]:
    for folder in dict.fromkeys((Path(tempfile.gettempdir()), Path.cwd())):
        free = shutil.disk_usage(folder).free
        state: State = "ok" if free >= _FREE_BYTES else "warning"
        advice = "" if state == "ok" else "recordings and images need room: make some"
        yield Finding("disk", state, f"{free / (1 << 30):.1f} GiB free in {folder}", advice)


def _engine() -> Iterator[Finding]:
    try:
        client = connect()
    except BackendError as error:
        yield Finding("docker engine", "warning", str(error), "needed for --backend docker only")
        return
    with contextlib.closing(client):
        version = client.version()
        yield Finding("docker engine", "ok", f"version {version.get('Version')}, API {version.get('ApiVersion')}")


def _compose() -> Iterator[Finding]:
    text = _output("docker", "compose", "version", "--short")
    numbers = tuple(int(n) for n in text.lstrip("v").split("-")[0].split(".")[:2] if n.isdecimal())
    advice = "install Compose v2 (docker-compose-plugin); needed for --backend docker only"
    if not numbers:
        yield Finding("compose", "warning", "docker compose does not answer", advice)
    elif numbers < _COMPOSE:
        yield Finding("compose", "warning", f"version {text} is older than 2.20", advice)
    else:
        yield Finding("compose", "ok", f"version {text}")


def _output(*command: str) -> str:
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return result.stdout.strip() if result.returncode == 0 else ""


def _left_behind() -> Iterator[Finding]:
    left = [f"test {about.get('test', '?')}" for prefix in ("cid-", leases.PROJECT) for about in _orphans(prefix)]
    if left:
        yield Finding("left behind", "warning", f"by killed runs: {', '.join(left)}", "dodo doctor --clean")
    else:
        yield Finding("left behind", "ok", "nothing of killed runs")


def _orphans(prefix: str) -> Iterator[dict[str, Any]]:
    for lease, about in leases.orphans(prefix):
        yield about
        lease.leave()


def _rigs() -> Iterator[Finding]:
    for rig, reason in rigs.all_quarantined().items():
        yield Finding(f"rig {rig}", "problem", f"in quarantine: {reason}", f"mend it, then dodo rig clear {rig}")


def _emulated_rig() -> Iterator[Finding]:
    """The programs that a gantry with ``--serial=emulated`` starts."""
    named = os.environ.get(FIRMWARE)
    places = (Path(named),) if named else EMULATOR_PLACES
    found = next((p for p in places if all((p / name).is_file() for name in ("rig-emulator", "gantry.elf"))), None)
    if found:
        yield Finding("emulated rig", "ok", f"is built, in {found}")
    else:
        advice = f"hil tests on it need it: make firmware in DoDo's checkout, or set {FIRMWARE} to its folder"
        yield Finding("emulated rig", "warning", f"is not built: it is not in {' or '.join(map(str, places))}", advice)


CHECKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    _namespaces,
    _multicast,
    _receive_buffer,
    _shared_memory,
    _disk,
    _engine,
    _compose,
    _left_behind,
    _rigs,
    _emulated_rig,
)


def clean() -> cleanup.Reaped:
    """Removes what killed runs left, as the next run would; says what it removed, and what it could not."""
    on_host = host_isolation.reap()
    try:
        client = connect()
    except BackendError:
        return cleanup.Reaped(on_host)
    with contextlib.closing(client):
        reaped = cleanup.reap_projects(client)
    return cleanup.Reaped([*on_host, *reaped.removed], reaped.left)
