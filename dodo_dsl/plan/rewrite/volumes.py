"""Volumes of a service: ``/tmp``, shared memory and named volumes are the test's own."""

from collections.abc import Mapping, MutableSequence
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.limit_findings import volume_excesses
from dodo_dsl.application.access.shared_findings import OWN_VOLUMES
from dodo_dsl.application.interpolation import split_outside
from dodo_dsl.plan.rewrite.container_limits import put
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_DISPLAYS = "/tmp/.X11-unix"


def renamed(name: str) -> str:
    """The name of an application's volume in the test's project."""
    return f"application-{name}" if name in OWN_VOLUMES else name


def own_mounts(copy: ServiceCopy) -> None:
    volumes = copy.service.get("volumes")
    if not isinstance(volumes, list):
        return
    changed = [_renamed(copy, volume) for volume in volumes]
    if copy.setting.own_network:
        changed = [own for volume in changed if (own := _own(copy, volume)) is not None]
    once = {repr((host_access.mount(v).source, host_access.mount(v).target)): v for v in changed}
    copy.keep_items("volumes", list(once.values()))


def _renamed(copy: ServiceCopy, volume: Any) -> Any:
    found = host_access.mount(volume)
    if found.source not in OWN_VOLUMES or (isinstance(volume, dict) and volume.get("type", "volume") != "volume"):
        return volume
    copy.note(f"volumes: {found.source} renamed to {renamed(found.source)}")
    if isinstance(volume, dict):
        return {**volume, "source": renamed(found.source)}
    return ":".join([renamed(found.source), *split_outside(volume, ":")[1:]])


def _own(copy: ServiceCopy, volume: Any) -> Any:
    """The mount as an isolated test has it, None for shared memory, which it has already."""
    found = host_access.mount(volume)
    if host_access.is_shared_memory(found):
        copy.note(f"volumes: {found.source} removed, shared memory is the test's own")
        return None
    is_token = found.below("/tmp") and found.source == found.target and not found.below(_DISPLAYS)
    if found.source != "/tmp" and not is_token:
        return volume
    copy.note("volumes: /tmp is the test's own")
    target = "/tmp" if is_token else found.target
    if isinstance(volume, str):
        options = [word for part in split_outside(volume, ":")[2:] for word in part.split(",") if word in ("ro", "rw")]
        return f"tmp:{target}:" + ",".join([*options, "nocopy"])  # the image's own /tmp must not change the test's
    read_only = {"read_only": True} if found.read_only else {}
    return {"type": "volume", "source": "tmp", "target": target, **read_only, "volume": {"nocopy": True}}


def without_name(about: Any) -> Any:
    """A volume, secret or config without the name that all of the host would share."""
    return {key: value for key, value in about.items() if key != "name"} if isinstance(about, dict) else about


def own_volumes(
    volumes: Any,
    changes: MutableSequence[str],
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008  (it is frozen)
    known: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Top-level ``volumes``: each test has its own, so names that all of the host would share are removed.

    File systems in memory get no more than a service may have; ``known`` are variables whose values are known.
    """
    found = {}
    for excess in list(volume_excesses(filled.value(volumes or {}, known or {}), limits)):
        put(volumes, excess)
        changes.append(f"volume {excess.steps[0]}: o is {excess.allowed}")
    for name, about in (volumes or {}).items():
        is_external = host_access.is_external(about)
        if isinstance(about, dict) and "name" in about and not is_external:
            changes.append(f"volume {renamed(name)}: name removed, each test has its own")
            found[renamed(name)] = without_name(about)
        else:
            found[renamed(name)] = about
    return found
