"""Which programs of a test listen on an OpenDLV bus, by what the kernel says of their sockets."""

import contextlib
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from dodo_dsl.opendlv.address import PORT
from dodo_dsl.run.machine_load.processes import living, owners

_PROC = Path("/proc")
_LOCAL, _INODE = 1, 9
"""Columns of ``/proc/PID/net/udp`` (proc_pid_net(5))."""
_SOCKET = "socket:["
_BUSES = bytes((225, 0, 0))


def listening(services: Mapping[int, str], proc: Path = _PROC) -> set[str] | None:
    """The services that have a socket at the bus's port; ``services`` are pids and names.

    The CID does not count: on a wrong one they hear nothing, however long somebody waits. None if the kernel shows
    the sockets of no process of a service.
    """
    found, seen, hidden = set(), set(), set()
    for pid, name in owners(services, living(proc)).items():
        try:
            if name not in found and (own := _sockets(proc / str(pid))) and own & _at_the_port(proc / str(pid)):
                found.add(name)
            seen.add(name)
        except (FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            continue
        except OSError:
            hidden.add(name)
    return found if hidden <= seen else None


def joined(process: Path = _PROC / "self") -> set[int] | None:
    """The CIDs whose buses programs have joined in the network of a process; None if the kernel does not say."""
    try:
        lines = (process / "net" / "igmp").read_text().splitlines()
    except OSError:
        return None
    groups = [int(line.split()[0], 16).to_bytes(4, sys.byteorder) for line in lines if line.startswith("\t")]
    return {parts[3] for parts in groups if parts[:3] == _BUSES and parts[3]}


def buses(processes: Iterable[int], proc: Path = _PROC) -> set[int]:
    """The CIDs whose buses programs have joined in the networks of processes, as far as the kernel says."""
    return set[int]().union(*(joined(proc / str(pid)) or () for pid in processes))


def _sockets(process: Path) -> set[str]:
    """The inodes of a process's sockets; raises OSError."""
    links = []
    for entry in (process / "fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # it was closed meanwhile
            links.append(str(entry.readlink()))
    return {link.removeprefix(_SOCKET).rstrip("]") for link in links if link.startswith(_SOCKET)}


def _at_the_port(process: Path) -> set[str]:
    """The inodes of all UDP sockets in a process's network that are at the bus's port; raises OSError."""
    rows = [line.split() for line in (process / "net" / "udp").read_text().splitlines()[1:]]
    return {words[_INODE] for words in rows if words[_LOCAL].endswith(f":{PORT:04X}")}
