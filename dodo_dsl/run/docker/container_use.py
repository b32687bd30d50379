"""The processes of a test's containers on this machine, and what those of its application have used."""

import contextlib
import threading
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.listeners import listening, members
from dodo_dsl.run.machine_load import service_use, snapshot
from dodo_dsl.run.machine_load.processes import PROC, ThreadTimes
from dodo_dsl.run.machine_load.service_use import ControlGroup, Used, UseReader
from dodo_dsl.run.machine_load.snapshot import Snapshot

ELSEWHERE = "the Docker engine runs its containers on another machine or in a virtual one"


class ContainerProcesses:
    """``containers`` are those of the engine's client, by service. May be used by one thread at a time."""

    def __init__(self, containers: Mapping[str, Any], proc: Path = PROC) -> None:
        self._containers = {name: c for name, c in containers.items() if name not in (SANDBOX, FILES)}
        self._proc = proc
        self._times = ThreadTimes(proc)
        self._services: dict[int, str] | None = None

    def load(self) -> Snapshot | None:
        """What the services have used so far; None if the engine runs one of them on another machine."""
        if self._services is None:
            self._services = self._pids(self._containers) or {}
        return snapshot.take(self._times, self._services, self._proc) if self._services else None

    def listeners(self, names: Collection[str], cid: int) -> set[str] | None:
        """The services among ``names`` that listen on an OpenDLV bus already; None if that cannot be seen.

        Where the kernel does not show this user their sockets, those do whose network has a member of the bus: each
        container has its own network, but on the host.
        """
        services = self._pids({name: c for name, c in self._containers.items() if name in names})
        if not services:
            return None
        found = listening(services, self._proc)
        if found is None:
            found = {name for pid, name in services.items() if members(cid, self._proc / str(pid)) != 0}
        return found

    def first(self, names: Collection[str]) -> Collection[int] | None:
        """The first processes of containers that run; None if one of them is not found here."""
        return self._pids({name: c for name, c in self._containers.items() if name in names})

    def _pids(self, containers: Mapping[str, Any]) -> dict[int, str] | None:
        """The first process of each container that runs; None if one of them is not found here."""
        found = {name: first_process(container, self._proc) for name, container in containers.items()}
        return None if None in found.values() else {pid: name for name, pid in found.items() if pid}


def first_process(container: Any, proc: Path = PROC) -> int | None:
    """The process here with which a container began, 0 if it does not run; None if the engine has it elsewhere.

    A process of another machine may have the number of one here.
    """
    from docker.errors import DockerException

    try:
        container.reload()
        pid = int(container.attrs["State"].get("Pid") or 0)
        return pid if not pid or container.id in (proc / str(pid) / "cgroup").read_text() else None
    except (DockerException, OSError):
        return None


class ContainerUse:
    """``containers`` are those of the engine's client, by service.

    What the kernel counts for a container's control group is read where the container runs on this machine, else the
    engine is asked. Where the kernel counts no memory of groups, as on a Raspberry Pi by default, processes add up.
    """

    def __init__(self, containers: Mapping[str, Any], proc: Path = PROC) -> None:
        self._containers = containers
        self._proc = proc
        self._limits: dict[str, int] = {}
        self._groups: dict[str, ControlGroup] = {}
        self._roots: dict[int, str] = {}
        self._elsewhere: list[str] = []
        self._processes = UseReader(proc)
        self._last: dict[str, Used] = {}
        self._lock = threading.Lock()

    def take(self) -> dict[str, Used] | None:
        """By service; None if nothing is known of one. One thread at a time does it, as one may be given up."""
        with self._lock:
            return self._take()

    def _take(self) -> dict[str, Used] | None:
        if not self._limits:
            self._find()
        found = {name: used for name, group in self._groups.items() if (used := group.used())}
        found |= self._processes.take(self._roots) if self._roots else {}
        found |= {name: used for name in self._elsewhere if (used := self._asked(name))}
        ended = {name: used._replace(memory=0) for name, used in self._last.items() if name not in found}
        self._last |= found
        return {name: used._replace(limit=self._limits[name]) for name, used in {**ended, **found}.items()} or None

    def _find(self) -> None:
        for name, container in self._containers.items():
            pid = first_process(container, self._proc)
            self._limits[name] = int(container.attrs.get("HostConfig", {}).get("Memory") or 0)
            if pid is None:
                self._elsewhere.append(name)
            elif pid and (group := service_use.of_process(pid, self._proc)) and group.used():
                self._groups[name] = group
            elif pid:
                self._roots[pid] = name

    def _asked(self, name: str) -> Used | None:
        from docker.errors import DockerException

        with contextlib.suppress(DockerException, OSError):
            container = self._containers[name]
            return service_use.of_engine(container.client.api.stats(container.id, stream=False, one_shot=True))
        return None
