"""What a test's containers use, and which of them listen on a bus, by their processes on this machine."""

import contextlib
import threading
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.listeners import joined, listening
from dodo_dsl.run.machine_load.processes import PROC
from dodo_dsl.run.machine_load.service_use import Snapshot, Used, UseReader
from dodo_dsl.run.process import process_group

ELSEWHERE = "the Docker engine runs its containers on another machine or in a virtual one"
_OF_1, _OF_2 = ("total_rss", "total_shmem"), ("anon", "shmem")
"""Anonymous and shared memory that the kernel counts for control groups (cgroups(7)) of both versions."""


class ContainerUse:
    """``containers`` are those of the engine's client, by service, ``application`` the application's.

    What these use is by their control groups, which count what has ended, too; where these count no memory, as on a
    Raspberry Pi by default, by processes. An engine elsewhere is asked, which takes a second.
    """

    def __init__(self, containers: Mapping[str, Any], application: Collection[str] = (), proc: Path = PROC) -> None:
        self._containers = {name: c for name, c in containers.items() if name not in (SANDBOX, FILES)}
        self._application = {name: c for name, c in self._containers.items() if name in application}
        self._proc = proc
        self._reader = UseReader(proc)
        self._reader.sized.update(self._application)
        self._pids: dict[int, str] | None = None
        self._last: Mapping[str, Used] = {}
        self._lock = threading.Lock()

    def take(self) -> Snapshot | None:
        """What is known of services; None if nothing is. One thread at a time does it, as one may be given up."""
        with self._lock:
            if self._pids is None:
                self._pids = self.first(self._containers) or {}
            taken = self._reader.take(self._pids) if self._pids else Snapshot(time.monotonic(), {})
            services = dict(taken.services)
            for name, container in self._application.items():
                pid = next((pid for pid, service in self._pids.items() if service == name), None)
                here = process_group.counted(self._proc / str(pid), self._proc / "self") if pid else (0.0, {})
                ran_s, rows = here if self._pids else self._asked(container)
                seen, last, memory = services.get(name), self._last.get(name), _memory(rows)
                if seen or last or memory is not None:
                    seen = seen or Used()
                    ran_s = max(ran_s, seen.processor_s, last.processor_s if last else 0.0)
                    limit = int(container.attrs.get("HostConfig", {}).get("Memory") or 0)
                    services[name] = Used(ran_s, seen.waited_s, seen.memory if memory is None else memory, limit)
            self._last = services
            return replace(taken, services=services, changes=0) if services else None

    @staticmethod
    def _asked(container: Any) -> tuple[float, Mapping[str, int]]:
        """Processor time and rows of memory by the engine (``GET /containers/ID/stats``), if it knows."""
        from docker.errors import DockerException

        with contextlib.suppress(DockerException, OSError, KeyError, TypeError):
            stats = container.client.api.stats(container.id, stream=False, one_shot=True)
            return stats["cpu_stats"]["cpu_usage"]["total_usage"] * 1e-9, stats["memory_stats"]["stats"]
        return 0.0, {}

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


def _memory(rows: Mapping[str, int]) -> int | None:
    names = _OF_1 if _OF_1[0] in rows else _OF_2
    return rows[names[0]] + rows.get(names[1], 0) if names[0] in rows else None


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
