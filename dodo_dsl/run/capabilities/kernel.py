"""What the kernel of this machine offers to tests, and its disks."""

import errno
import os
import shutil
import socket
import struct
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl import advice
from dodo_dsl.opendlv.bus.address import RECEIVE_BUFFER, group
from dodo_dsl.run.capabilities.finding import Capability, State
from dodo_dsl.run.process import host_isolation

_RECEIVE_S = 1.0
_BUSES = "225.0.0.0/24"
"""The groups of all sessions."""
_NO_ROUTE = (errno.ENETUNREACH, errno.ENODEV, errno.EADDRNOTAVAIL)
_SYS = Path("/proc/sys")
_FREE_BYTES = 2 << 30
_SEGMENTS = 64
_SEGMENT_BYTES = 64 << 20


def namespaces() -> Iterator[Capability]:
    """Whether tests can have namespaces of their own."""
    if refusal := host_isolation.isolation_refusal():
        remedy = f"{refusal.remedy}; " if refusal.remedy else ""
        way = f"{remedy}for applications you trust, --isolation host"
        yield Capability("namespaces", "problem", f"an application cannot be isolated: {refusal}", way)
    else:
        yield Capability(
            "namespaces", "ok", "each test gets a network, IPC and /tmp of its own, its application a sandbox"
        )


def multicast() -> Iterator[Capability]:
    """Whether a datagram to a multicast group is received."""
    bus, mark = group(254), os.urandom(16)
    membership = socket.inet_aton(bus[0]) + struct.pack("=I", socket.INADDR_ANY)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind(bus)
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            receiver.settimeout(_RECEIVE_S)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.sendto(mark, bus)
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


def receive_buffer() -> Iterator[Capability]:
    """Whether sockets may buffer as much as OpenDLV requests."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        limit = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # the kernel tells what it reserves
    if limit < RECEIVE_BUFFER:
        text = f"sockets may hold {limit:,} bytes, OpenDLV requests {RECEIVE_BUFFER:,}: bursts of messages may be lost"
        yield Capability("receive buffer", "warning", text, _sysctl(f"net.core.rmem_max={RECEIVE_BUFFER}"))
    else:
        yield Capability("receive buffer", "ok", f"sockets may hold {limit:,} bytes")


def shared_memory() -> Iterator[Capability]:
    """Whether the limits of System V shared memory suffice."""
    segments, size = _number("/proc/sys/kernel/shmmni"), _number("/proc/sys/kernel/shmmax")
    if segments < _SEGMENTS or size < _SEGMENT_BYTES:
        way = _sysctl(f"kernel.shmmni={max(segments, 4096)}", f"kernel.shmmax={max(size, _SEGMENT_BYTES * 16)}")
        yield Capability("shared memory", "problem", f"only {segments} segments of {size:,} bytes are allowed", way)
    else:
        yield Capability("shared memory", "ok", f"{segments:,} segments are allowed")


def _sysctl(*settings: str) -> str:
    """Sets limits of the kernel; in a container, whose /proc/sys is read-only, they are its host's."""
    path = _SYS / settings[0].partition("=")[0].replace(".", "/")
    is_host = path.exists() and (os.geteuid() != 0 or os.access(path, os.W_OK))
    return (
        advice.as_root(f"sysctl -w {' '.join(settings)}") if is_host else f"on the host: sysctl -w {' '.join(settings)}"
    )


def _number(path: str) -> int:
    try:
        return int(Path(path).read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0


def disk() -> Iterator[Capability]:
    """Whether there is room for recordings and images."""
    for folder in dict.fromkeys((Path(tempfile.gettempdir()), Path.cwd())):
        free = shutil.disk_usage(folder).free
        state: State = "ok" if free >= _FREE_BYTES else "warning"
        way = "" if state == "ok" else "free some space: recordings and images need it"
        yield Capability("disk", state, f"{free / (1 << 30):.1f} GiB free in {folder}", way)
