"""The processes of a test's containers on this machine, and what they have used."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.load import snapshot
from dodo_dsl.run.load.snapshot import PROC, Snapshot
from dodo_dsl.run.load.thread_times import ThreadTimes
from dodo_dsl.run.services.listeners import listening, members

ELSEWHERE = "the Docker engine runs its containers on another machine or in a virtual one"


class ContainerProcesses:
    """``containers`` are those of the engine's client, by service. May be used by one thread at a time."""

    def __init__(self, containers: Mapping[str, Any], proc: Path = PROC) -> None:
        self._containers = {name: c for name, c in containers.items() if name not in (SANDBOX, FILES)}
        self._proc = proc
        self._times = ThreadTimes(proc)
        self._services: dict[int, str] | None = None

    def load(self) -> Snapshot | None:
        """What the services have used so far; None where the engine runs one of them on another machine."""
        if self._services is None:
            self._services = self._pids(self._containers) or {}
        return snapshot.take(self._times, self._services, self._proc) if self._services else None

    def listeners(self, names: Collection[str], cid: int) -> set[str] | None:
        """The services among ``names`` that listen on an OpenDLV bus already; None where that cannot be seen.

        Where the kernel does not show this user their sockets, those do whose network has a member of the bus: each
        container has a network of its own, but on the host.
        """
        services = self._pids({name: c for name, c in self._containers.items() if name in names})
        if not services:
            return None
        found = listening(services, self._proc)
        if found is None:
            found = {name for pid, name in services.items() if members(cid, self._proc / str(pid)) != 0}
        return found

    def first(self, names: Collection[str]) -> Collection[int] | None:
        """The first processes of containers that run; None where one of them is not found here."""
        return self._pids({name: c for name, c in self._containers.items() if name in names})

    def _pids(self, containers: Mapping[str, Any]) -> dict[int, str] | None:
        """The first process of each container that runs; None where one of them is not found here."""
        from docker.errors import DockerException

        found = {}
        for name, container in containers.items():
            try:
                container.reload()
            except (DockerException, OSError):
                return None
            pid = int(container.attrs["State"].get("Pid") or 0)
            if pid and not is_of(pid, container.id, self._proc):
                return None
            found[pid] = name
        found.pop(0, None)
        return found


def is_of(pid: int, container: str, proc: Path = PROC) -> bool:
    """Whether a process here is that of the container, and not one of another machine with the same number."""
    try:
        return container in (proc / str(pid) / "cgroup").read_text()
    except OSError:
        return False
