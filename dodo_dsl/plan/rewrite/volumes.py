"""Volumes of a service: ``/tmp``, shared memory and named volumes are the test's own."""

from collections.abc import Collection, Iterable, Mapping, MutableSequence
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.limit_findings import volume_excesses
from dodo_dsl.application.interpolation import split_outside
from dodo_dsl.plan.rewrite.container_limits import put
from dodo_dsl.plan.rewrite.file_copies import of_volume, own_name, read_only
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_LONGEST = 255
"""Characters of a volume's name on the engine: it is a folder's."""
_MARK = "xxxxxx"
"""In the place of what tells projects of one test apart."""


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
    copies = copy.setting.copies
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


def _to_read(about: Any, paths: HostPaths | None) -> str:
    """``o`` of a volume that could be written to and is only to be read; empty for all others."""
    if not host_access.is_bound(about) or host_access.is_read_only(about):
        return ""
    device = str(about["driver_opts"].get("device") or "")
    if "$" not in device and (paths is None or not paths.is_only_read(device)):
        return ""
    words = (word.strip() for word in host_access.volume_options(about))
    return ",".join([*(word for word in words if word not in ("", "ro", "rw")), "ro"])


def too_long(slug: str, volumes: Iterable[str]) -> str:
    """A volume whose name in the test's project is longer than the engine takes; empty without one."""
    return next((name for name in volumes if len(f"dodo-{slug}-{_MARK}_{name}") > _LONGEST), "")


def own_volumes(
    volumes: Any,
    changes: MutableSequence[str],
    copies: Collection[str] = (),
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008  (it is frozen)
    known: Mapping[str, str] | None = None,
    paths: HostPaths | None = None,
) -> dict[str, Any]:
    """Top-level ``volumes``: each test has its own, so names that all of the host would share are removed.

    File systems in memory get no more than a service may have; ``known`` are variables whose values are known. A folder
    of the repository is one of the ``copies``; what ``paths`` lets be read alone, or does not know, is read-only.
    """
    found: dict[str, Any] = {}
    for excess in list(volume_excesses(filled.value(volumes or {}, known or {}), limits)):
        put(volumes, excess)
        changes.append(f"volume {excess.steps[0]}: o is {excess.allowed}")
    for name, about in (volumes or {}).items():
        if own_name(name) in copies:
            found[own_name(name)] = {}
            continue
        if options := _to_read(filled.value(about, known or {}), paths):
            about["driver_opts"]["o"] = options
            changes.append(f"volume {own_name(name)}: is only read")
        if isinstance(about, dict) and about.pop("labels", None):
            changes.append(f"volume {own_name(name)}: labels removed, programs of the host act on them")
        is_external = host_access.is_external(about)
        if isinstance(about, dict) and "name" in about and not is_external:
            changes.append(f"volume {own_name(name)}: name removed, each test has its own")
            found[own_name(name)] = without_name(about)
        else:
            found[own_name(name)] = about
    return {**found, **{name: {} for name in copies if name not in found}}
