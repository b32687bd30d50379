"""What the processes of a container have used, as the kernel counts it for their control groups (versions 1 and 2)."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.run.load.service_use import Used

_NANOSECONDS, _MICROSECONDS = 1e-9, 1e-6
_MOST = 4096
_OF_1 = ("total_rss", "total_shmem")
_OF_2 = ("anon", "shmem")
"""Anonymous and shared memory in ``memory.stat``; copies of files do not count, which the kernel drops when it must."""


@dataclass(frozen=True)
class ControlGroup:
    """The files that tell memory and processor time; ``tick_s`` is the unit of the latter."""

    memory: Path
    processor: Path
    tick_s: float

    def used(self) -> Used | None:
        """What was used so far; None where the kernel does not tell, or when the group is gone."""
        try:
            memory = memory_of(numbers(self.memory.read_text()))
            text = self.processor.read_text()
        except (OSError, ValueError):
            return None
        ticks = numbers(text).get("usage_usec") if " " in text else int(text)
        return None if memory is None or ticks is None else Used(ticks * self.tick_s, memory)


def processor_s(descriptor: int) -> float | None:
    """Seconds by an open ``cpuacct.usage`` or ``cpu.stat``; None where the kernel does not tell."""
    try:
        text = os.pread(descriptor, _MOST, 0).decode()
        ticks = numbers(text).get("usage_usec") if " " in text else int(text)
    except (OSError, ValueError):
        return None
    return None if ticks is None else ticks * (_MICROSECONDS if " " in text else _NANOSECONDS)


def of_process(pid: int, proc: Path = Path("/proc")) -> ControlGroup | None:
    """The group of a process; None where it has none that counts both, as without the controller of memory."""
    try:
        mounts = (proc / "self" / "mountinfo").read_text()
        groups = (proc / str(pid) / "cgroup").read_text()
    except OSError:
        return None
    places = _places(mounts, groups)
    memory, processor = places.get("memory"), places.get("cpuacct")
    if memory and processor:
        return ControlGroup(memory / "memory.stat", processor / "cpuacct.usage", _NANOSECONDS)
    unified = places.get("")
    if unified and (unified / "memory.stat").is_file():
        return ControlGroup(unified / "memory.stat", unified / "cpu.stat", _MICROSECONDS)
    return None


def memory_of(stat: Mapping[str, int]) -> int | None:
    """Bytes of memory by the rows of ``memory.stat``; None where they do not tell."""
    names = _OF_1 if _OF_1[0] in stat else _OF_2
    return stat[names[0]] + stat.get(names[1], 0) if names[0] in stat else None


def of_engine(stats: Mapping[str, Any]) -> Used | None:
    """What the engine says of a container (``GET /containers/ID/stats``); None where it does not know."""
    try:
        memory = memory_of(stats["memory_stats"]["stats"])
        return None if memory is None else Used(stats["cpu_stats"]["cpu_usage"]["total_usage"] * _NANOSECONDS, memory)
    except (KeyError, TypeError):
        return None


def numbers(text: str) -> dict[str, int]:
    """Rows of a name and a number."""
    return {name: int(number) for name, number in (line.split() for line in text.splitlines())}


def _places(mounts: str, groups: str) -> dict[str, Path]:
    """The folder of a process's group by controller, that of version 2 under an empty name.

    ``mounts`` and ``groups`` are the texts of ``mountinfo`` and ``cgroup`` (proc_pid_mountinfo(5), cgroups(7)).
    """
    paths: dict[str, str] = {}
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        paths |= dict.fromkeys(controllers.split(","), path)
    found: dict[str, Path] = {}
    for line in mounts.splitlines():
        before, _, after = line.partition(" - ")
        root, point = before.split()[3:5]
        kind, _, options = after.split()[:3]
        names = options.split(",") if kind == "cgroup" else [""] if kind == "cgroup2" else []
        for name in names:
            if name in paths and (place := _below(paths[name], root)) is not None:
                found.setdefault(name, Path(point + place))
    return found


def _below(path: str, root: str) -> str | None:
    """A group's path in a mount that shows only what is below ``root``; None where it is not shown."""
    if root == "/":
        return path
    return path.removeprefix(root) if path == root or path.startswith(f"{root}/") else None
