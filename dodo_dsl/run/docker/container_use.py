"""What a test's containers use, and which of them listen on a bus, by their processes on this machine."""

import threading
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from docker.errors import DockerException

from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.listeners import joined, listening
from dodo_dsl.run.machine_load.processes import PROC
from dodo_dsl.run.machine_load.service_use import Snapshot, UseReader

ELSEWHERE = "the Docker engine runs its containers on another machine or in a virtual one"


class ContainerUse:
    """``containers`` are those of the engine's client, by service, ``application`` the application's."""

    def __init__(self, containers: Mapping[str, Any], application: Collection[str] = (), proc: Path = PROC) -> None:
        self._containers = {name: c for name, c in containers.items() if name not in (SANDBOX, FILES)}
        self._proc = proc
        self._reader = UseReader(proc)
        self._reader.sized.update(application)
        self._pids: dict[int, str] | None = None
        self._lock = threading.Lock()

    def take(self) -> Snapshot | None:
        """What is known of services; None if nothing is. One thread at a time does it, as one may be given up."""
        with self._lock:
            if self._pids is None:
                self._pids = self.first(self._containers) or {}
            return self._reader.take(self._pids) if self._pids else None

    def listeners(self, names: Collection[str], cid: int) -> set[str] | None:
        """The services among ``names`` that listen on an OpenDLV bus already; None if that cannot be seen.

        Where the kernel does not show this user their sockets, those do whose network has a member of the bus: each
        container has its own network, but on the host.
        """
        if not (services := self.first(names)):
            return None
        found = listening(services, self._proc)
        if found is None:
            found = {n for pid, n in services.items() if (cids := joined(self._proc / str(pid))) is None or cid in cids}
        return found

    def first(self, names: Collection[str]) -> dict[int, str] | None:
        """The first processes of containers that run; None if one of them is not found here."""
        found = {name: first_process(c, self._proc) for name, c in self._containers.items() if name in names}
        return None if None in found.values() else {pid: name for name, pid in found.items() if pid}


def first_process(container: Any, proc: Path = PROC) -> int | None:
    """The process here with which a container began, 0 if it does not run; None if the engine has it elsewhere.

    A process of another machine may have the number of one here.
    """
    try:
        container.reload()
        pid = int(container.attrs["State"].get("Pid") or 0)
        return pid if not pid or container.id in (proc / str(pid) / "cgroup").read_text() else None
    except (DockerException, OSError):
        return None
