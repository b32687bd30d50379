"""Volumes of a service: ``/tmp``, shared memory and named volumes are the test's own.

Files of the repository are only read, or are copies of the test that it may change.
"""

import re
from collections.abc import Iterable, Mapping, MutableSequence
from pathlib import Path
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.limit_findings import put, volume_limits
from dodo_dsl.application.access.value_findings import OWN_VOLUMES
from dodo_dsl.application.interpolation import interpolated, split_outside
from dodo_dsl.plan.rewrite.service_copy import ComposeProject, ServiceCopy

COPY = "files-"
"""How the volumes of copies begin, each with a number."""
_OF_COPY = re.compile(rf"{COPY}\d+")
_ACCESS = ("ro", "rw")


def own_name(name: str) -> str:
    """The name of an application's volume in the test's project, where DoDo has its own volumes."""
    return f"application-{name}" if name in OWN_VOLUMES or _OF_COPY.fullmatch(name) else name


class FileCopies:
    """The folders that a test copies: those of the repository that any of its services mounts to write to.

    All services that mount such a folder share its copy; what is mounted next to it comes from the repository. So no
    service can lead the mount of another one elsewhere. ``paths`` are relative to the compiled test's folder, as the
    services and volumes are; ``known`` are the variables whose values are known. ``sources`` are the volumes of the
    copies, each with the folder that it has at the start, as the compose file writes it.
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
            seen = interpolated(about, known)
            if host_access.is_bound(seen) and self._folder(str(seen["driver_opts"].get("device"))):
                self._names[f"volume {own_name(name)}"] = own_name(name)
                self.sources[own_name(name)] = str(about["driver_opts"]["device"])

    def _add(self, volume: Any) -> None:
        found = host_access.mount(interpolated(volume, self._known))
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
        """The volume with the copy that a mount shows; empty if it shows none."""
        found = host_access.mount(interpolated(volume, self._known))
        if host_access.is_bind(volume, found.source):
            return self._names.get(self._folder(found.source), "")
        return self._names.get(f"volume {found.source}", "")

    def is_to_read(self, volume: Any) -> bool:
        """Whether a mount that could be written to is only to be read: one of a file, or of an unknown path."""
        found = host_access.mount(interpolated(volume, self._known))
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


def own_mounts(copy: ServiceCopy) -> None:
    volumes = copy.service.get("volumes")
    if not isinstance(volumes, list):
        return
    changed = [_renamed(copy, volume) for volume in volumes]
    of_test = _own_tmp if copy.setting.own_network else _tmp_of_host
    changed = [own for volume in changed if (own := of_test(copy, volume)) is not None]
    changed = [_of_repository(copy, volume) for volume in changed]
    once = {repr((host_access.mount(v).source, host_access.mount(v).target)): v for v in changed}
    copy.keep_items("volumes", list(once.values()))


def _renamed(copy: ServiceCopy, volume: Any) -> Any:
    found = host_access.mount(volume)
    name = own_name(found.source)
    if name == found.source or (isinstance(volume, dict) and volume.get("type", "volume") != "volume"):
        return volume
    copy.note(f"volumes: {found.source} renamed to {name}")
    if isinstance(volume, dict):
        return {**volume, "source": name}
    return ":".join([name, *split_outside(volume, ":")[1:]])


def _own_tmp(copy: ServiceCopy, volume: Any) -> Any:
    """The mount as an isolated test has it, None for shared memory, which it has already."""
    found = host_access.mount(volume)
    if host_access.is_shared_memory(found):
        copy.note(f"volumes: {found.source} removed, shared memory is the test's own")
        return None
    is_token = host_access.is_token(found)
    if found.source != "/tmp" and not is_token:
        return volume
    copy.note("volumes: /tmp is the test's own")
    target = "/tmp" if is_token else found.target
    if isinstance(volume, dict):
        return of_volume({**volume, "target": target}, "tmp")
    return of_volume(f"{found.source}:{target}{':ro' if found.read_only else ''}", "tmp")


def _tmp_of_host(copy: ServiceCopy, volume: Any) -> Any:
    """The mount as a test on the host's network has it: all of ``/tmp``, where shared memory is found."""
    found = host_access.mount(volume)
    if not host_access.is_token(found) or found.source == "/tmp":
        return volume
    copy.note(f"volumes: {found.source} is /tmp, where the host's services are")
    if isinstance(volume, dict):
        return {**volume, "source": "/tmp", "target": "/tmp"}
    return ":".join(["/tmp", "/tmp", *split_outside(volume, ":")[2:]])


def _of_repository(copy: ServiceCopy, volume: Any) -> Any:
    """The mount with the test's copy of a folder of the repository, or to be read only."""
    copies = copy.project.copies
    if copies is None:
        return volume
    if name := copies.name(volume):
        copy.note(f"volumes: {host_access.mount(volume).target} is the test's own copy of {copies.sources[name]}")
        return of_volume(volume, name)
    if not copies.is_to_read(volume):
        return volume
    copy.note(f"volumes: {host_access.mount(volume).source} is only read")
    return read_only(volume)


def without_name(about: Any) -> Any:
    """A volume, secret or config without the name that all of the host would share."""
    return {key: value for key, value in about.items() if key != "name"} if isinstance(about, dict) else about


def _to_read(about: Any, paths: HostPaths) -> str:
    """``o`` of a volume that could be written to and is only to be read; empty for all others."""
    if not host_access.is_bound(about) or host_access.is_read_only(about):
        return ""
    device = str(about["driver_opts"].get("device") or "")
    if "$" not in device and not paths.is_only_read(device):
        return ""
    words = (word.strip() for word in host_access.volume_options(about))
    return ",".join([*(word for word in words if word not in ("", "ro", "rw")), "ro"])


def own_volumes(volumes: Any, changes: MutableSequence[str], project: ComposeProject) -> dict[str, Any]:
    """Top-level ``volumes``: each test has its own, so names that all of the host would share are removed.

    File systems in memory get no more than a service may have. A folder of the repository is one of the project's
    copies; what may only be read, or is not known, is read-only.
    """
    found: dict[str, Any] = {}
    copies = project.copies.sources if project.copies else {}
    for name, about in (volumes or {}).items():
        for finding in list(volume_limits(name, interpolated(about, project.known), project.setting.limits)):
            put(about, finding)
            changes.append(f"volume {name}: o is {finding.allowed}")
    for name, about in (volumes or {}).items():
        if own_name(name) in copies:
            found[own_name(name)] = {}
            continue
        if options := _to_read(interpolated(about, project.known), project.look.paths):
            about["driver_opts"]["o"] = options
            changes.append(f"volume {own_name(name)}: is only read")
        if isinstance(about, dict) and about.pop("labels", None):
            changes.append(f"volume {own_name(name)}: labels removed, programs of the host act on them")
        if isinstance(about, dict) and "name" in about and not host_access.is_external(about):
            changes.append(f"volume {own_name(name)}: name removed, each test has its own")
            del about["name"]
        found[own_name(name)] = about
    return {**found, **{name: {} for name in copies if name not in found}}
