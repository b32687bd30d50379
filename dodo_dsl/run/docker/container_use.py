"""What the containers of a test's application have used."""

import contextlib
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.run.docker.processes import is_of
from dodo_dsl.run.load import control_group
from dodo_dsl.run.load.control_group import ControlGroup
from dodo_dsl.run.load.process_memory import PROC
from dodo_dsl.run.load.service_use import Used, UseReader


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
        """By service; None where nothing can be told of one. One thread at a time does it, as one may be given up."""
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
        from docker.errors import DockerException

        for name, container in self._containers.items():
            with contextlib.suppress(DockerException, OSError):
                container.reload()
            self._limits[name] = int(container.attrs.get("HostConfig", {}).get("Memory") or 0)
            pid = int(container.attrs["State"].get("Pid") or 0)
            if not pid:
                continue
            if not is_of(pid, container.id, self._proc):
                self._elsewhere.append(name)
            elif (group := control_group.of_process(pid, self._proc)) and group.used():
                self._groups[name] = group
            else:
                self._roots[pid] = name

    def _asked(self, name: str) -> Used | None:
        from docker.errors import DockerException

        with contextlib.suppress(DockerException, OSError):
            container = self._containers[name]
            return control_group.of_engine(container.client.api.stats(container.id, stream=False, one_shot=True))
        return None
