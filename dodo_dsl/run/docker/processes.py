"""The processes of a test's containers on this machine, and what they have used."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import SANDBOX
from dodo_dsl.run.load import snapshot
from dodo_dsl.run.load.snapshot import PROC, Snapshot
from dodo_dsl.run.load.thread_times import ThreadTimes


class ContainerProcesses:
    """``containers`` are those of the engine's client, by service. May be used by one thread at a time."""

    def __init__(self, containers: Mapping[str, Any], proc: Path = PROC) -> None:
        self._containers = {name: c for name, c in containers.items() if name != SANDBOX}
        self._proc = proc
        self._times = ThreadTimes(proc)
        self._services: dict[int, str] | None = None

    def load(self) -> Snapshot | None:
        """What the services have used so far; None where the engine runs one of them on another machine."""
        if self._services is None:
            self._services = self._find()
        return snapshot.take(self._times, self._services, self._proc) if self._services else None

    def _find(self) -> dict[int, str]:
        """The first process of each container that runs; none at all where one of them is not found here."""
        from docker.errors import DockerException

        found = {}
        for name, container in self._containers.items():
            try:
                container.reload()
            except (DockerException, OSError):
                return {}
            pid = int(container.attrs["State"].get("Pid") or 0)
            if pid and not is_of(pid, container.id, self._proc):
                return {}
            found[pid] = name
        found.pop(0, None)
        return found


def is_of(pid: int, container: str, proc: Path = PROC) -> bool:
    """Whether a process here is that of the container, and not one of another machine with the same number."""
    try:
        return container in (proc / str(pid) / "cgroup").read_text()
    except OSError:
        return False
