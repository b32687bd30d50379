"""Which programs of a test listen on an OpenDLV bus, by what the kernel says of their sockets."""

import socket
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from dodo_dsl.opendlv.address import PORT, group
from dodo_dsl.run.machine_load.processes import living, owners

_PROC = Path("/proc")
_LOCAL, _INODE = 1, 9
"""Columns of ``/proc/PID/net/udp`` (proc_pid_net(5))."""
_SOCKET = "socket:["
_BUSES, _HEX_DIGITS = bytes((225, 0, 0)), 8


def listening(services: Mapping[int, str], proc: Path = _PROC) -> set[str] | None:
    """The services that have a socket at the bus's port; ``services`` are pids and names.

    The CID does not count: on a wrong one they hear nothing, however long somebody waits. None if the kernel shows
    the sockets of no process of a service.
    """
    found, seen, hidden = set(), set(), set()
    for pid, name in owners(services, living(proc)).items():
        try:
            if name not in found and (own := _sockets(proc / str(pid))):
                found |= set() if own.isdisjoint(_at_the_port(proc / str(pid))) else {name}
            seen.add(name)
        except (FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            continue
        except OSError:
            hidden.add(name)
    return found if hidden <= seen else None


def members(cid: int, process: Path = _PROC / "self") -> int | None:
    """How many sockets have joined a bus in the network of a process; None if the kernel does not say."""
    wanted = f"{int.from_bytes(socket.inet_aton(group(cid)[0]), sys.byteorder):08X}"
    try:
        rows = [line.split() for line in (process / "net" / "igmp").read_text().splitlines()]
    except OSError:
        return None
    return sum(int(words[1]) for words in rows if words[0] == wanted)


def buses(processes: Iterable[int], proc: Path = _PROC) -> set[int]:
    """The CIDs whose buses programs have joined in the networks of processes, as far as the kernel says."""
    found = set()
    for pid in processes:
        try:
            words = [line.split() for line in (proc / str(pid) / "net" / "igmp").read_text().splitlines()]
        except OSError:
            continue
        groups = [int(each[0], 16).to_bytes(4, sys.byteorder) for each in words if _is_group(each[0])]
        found |= {parts[3] for parts in groups if parts[:3] == _BUSES and parts[3]}
    return found


def _is_group(word: str) -> bool:
    return len(word) == _HEX_DIGITS and set(word) <= set("0123456789ABCDEF")


def _sockets(process: Path) -> set[str]:
    """The inodes of a process's sockets; raises OSError."""
    return {link.removeprefix(_SOCKET).rstrip("]") for link in _links(process / "fd") if link.startswith(_SOCKET)}


def _links(folder: Path) -> Iterator[str]:
    for entry in folder.iterdir():
        try:
            yield str(entry.readlink())
        except FileNotFoundError:  # it was closed meanwhile
            continue


def _at_the_port(process: Path) -> set[str]:
    """The inodes of all UDP sockets in a process's network that are at the bus's port; raises OSError."""
    rows = [line.split() for line in (process / "net" / "udp").read_text().splitlines()[1:]]
    return {words[_INODE] for words in rows if words[_LOCAL].endswith(f":{PORT:04X}")}
