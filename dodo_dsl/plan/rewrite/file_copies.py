"""Files of the repository as a test mounts them: to be read only, or as copies of its own that it may change."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.shared_findings import OWN_VOLUMES
from dodo_dsl.application.interpolation import split_outside

COPY = "files-"
"""How the volumes of copies begin, each with a number."""
_OF_COPY = re.compile(rf"{COPY}\d+")
_ACCESS = ("ro", "rw")


def own_name(name: str) -> str:
    """The name of an application's volume in the test's project, where DoDo has volumes of its own."""
    return f"application-{name}" if name in OWN_VOLUMES or _OF_COPY.fullmatch(name) else name


class FileCopies:
    """The folders that a test copies: those of the repository that any of its services mounts to write to.

    All services that mount such a folder share its copy; what is mounted beside it comes from the repository. So no
    service can lead the mount of another one elsewhere. ``paths`` are relative to the compiled test's folder, as the
    services and volumes are; ``known`` are the variables whose values are known. ``sources`` are the volumes of the
    copies, each with the folder that it has at the begin, as the compose file writes it.
    """

    def __init__(
        self, paths: HostPaths, known: Mapping[str, str], services: Iterable[Mapping[str, Any]], volumes: Any
    ) -> None:
        self._paths = paths
        self._known = known
        self._names: dict[str, str] = {}
        self.sources: dict[str, str] = {}
        for service in services:
            for volume in service.get("volumes") or ():
                self._add(volume)
        for name, about in volumes.items() if isinstance(volumes, dict) else ():
            seen = filled.value(about, known)
            if host_access.is_bound(seen) and self._folder(str(seen["driver_opts"].get("device"))):
                self._names[f"volume {own_name(name)}"] = own_name(name)
                self.sources[own_name(name)] = str(about["driver_opts"]["device"])

    def _add(self, volume: Any) -> None:
        found = host_access.mount(filled.value(volume, self._known))
        if found.read_only or not host_access.is_bind(volume, found.source):
            return
        place = self._folder(found.source)
        if place and place not in self._names:
            self._names[place] = f"{COPY}{len(self._names)}"
            self.sources[self._names[place]] = host_access.mount(volume).source

    def _folder(self, source: str) -> str:
        """The real path of a folder of the repository, which may be missing yet; empty for files and other paths."""
        paths = self._paths
        if "$" in source or not paths.is_own(source) or paths.is_writable(source):
            return ""
        place = paths.names(source)[-1]
        return "" if Path(place).is_file() else place

    def name(self, volume: Any) -> str:
        """The volume with the copy that a mount shows; empty where it shows none."""
        found = host_access.mount(filled.value(volume, self._known))
        if host_access.is_bind(volume, found.source):
            return self._names.get(self._folder(found.source), "")
        return self._names.get(f"volume {found.source}", "")

    def is_to_read(self, volume: Any) -> bool:
        """Whether a mount that could be written to is only to be read: one of a file, or of an unknown path."""
        found = host_access.mount(filled.value(volume, self._known))
        if found.read_only or not host_access.is_bind(volume, found.source):
            return False
        return "$" in found.source or self._paths.is_only_read(found.source)


def of_volume(volume: Any, name: str) -> Any:
    """The mount with a volume of the test in the place of its source, without what an image has there."""
    found = host_access.mount(volume)
    if isinstance(volume, str):
        words = ["ro"] if found.read_only else []
        return f"{name}:{split_outside(volume, ':')[1]}:{','.join([*words, 'nocopy'])}"
    read_only = {"read_only": True} if found.read_only else {}
    return {"type": "volume", "source": name, "target": volume.get("target"), **read_only, "volume": {"nocopy": True}}


def read_only(volume: Any) -> Any:
    """The same mount, without write access."""
    if isinstance(volume, dict):
        return {**volume, "read_only": True}
    source, *target = split_outside(volume, ":")[:2]
    words = [word for word in host_access.mount_options(volume) if word and word not in _ACCESS]
    return ":".join([source, *target, ",".join([*words, "ro"])]) if target else volume
