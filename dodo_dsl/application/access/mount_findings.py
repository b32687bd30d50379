"""What a service may not mount."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import rig_ports
from dodo_dsl.application.access.compose_keys import MOUNT
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import AccessFinding, Steps, key_findings
from dodo_dsl.application.compose_paths import is_path

TYPES = ("bind", "volume", "tmpfs", "image")
PRIVATE = ("private", "rprivate", "")
_SOCKET_HINT = "give the service a profile, so that it starts with 'docker compose --profile' and not in a test"
_WITHOUT = "is left out of sil and dil tests, which have no hardware"


def mount_findings(
    name: str, service: Mapping[str, Any], paths: HostPaths, volumes: Mapping[str, Any], ports: Sequence[str] = ()
) -> Iterator[AccessFinding]:
    """Mounts of the host, of its hardware, of rigs' ``ports``, and of ``volumes`` that others use, too."""
    written = service.get("volumes")
    for item, volume in enumerate(written if isinstance(written, list) else ()):
        found = host_access.mount(volume)
        steps: Steps = ("volumes", item)
        if isinstance(volume, dict):
            yield from (f.below(*steps) for f in _long_form(name, volume))
            steps = (*steps, "source") if "source" in volume else steps
        if _is_bind(volume, found.source):
            yield from (f.below(*steps) for f in _bind(name, found, paths, ports))
            continue
        about = volumes.get(found.source)
        if host_access.is_external(about) and not found.read_only:
            hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
            yield AccessFinding(steps, f"volume '{found.source}' is external, so tests would share it", hint)


def _is_bind(volume: Any, source: str) -> bool:
    if isinstance(volume, dict):
        return volume.get("type") not in ("tmpfs", "image") and (volume.get("type") == "bind" or is_path(source))
    return is_path(source)


def _bind(name: str, found: host_access.Mount, paths: HostPaths, ports: Sequence[str]) -> Iterator[AccessFinding]:
    problem, hint = "", ""
    seen = host_access.Mount(paths.whole(found.source), found.target, found.read_only)
    if "$" in found.source:
        return
    if host_access.is_machine(seen):
        problem, hint = f"'{found.source}' belongs to the host, so tests would share it", _SOCKET_HINT
    elif host_access.is_of_machine(seen.source):
        problem, hint = f"'{found.source}' gives access to the host's disks or memory", "remove it"
    elif rig_ports.is_port(seen.source, ports):
        yield AccessFinding((), f"'{found.source}' of '{name}' {rig_ports.WHY}", rig_ports.HINT, "port")
    elif host_access.is_hardware(seen) and found.source.startswith("/"):
        yield AccessFinding((), f"'{found.source}' of '{name}' {_WITHOUT}", kind="hardware")
    else:
        problem, hint = paths.mount_problem(found.source, found.read_only)
    if problem:
        yield AccessFinding((), problem, hint)


def _long_form(name: str, volume: dict[str, Any]) -> Iterator[AccessFinding]:
    yield from key_findings(f"a mount of '{name}'", MOUNT, volume)
    kind = str(volume.get("type", ""))
    if kind and "$" not in kind and kind not in TYPES:
        yield AccessFinding(("type",), f"mounts of type '{kind}' cannot be isolated", f"use one of {', '.join(TYPES)}")
    bind = volume.get("bind")
    propagation = str(bind.get("propagation") or "") if isinstance(bind, dict) else ""
    if propagation not in PRIVATE and "$" not in propagation:
        message = f"propagation '{propagation}' lets mounts in and out of the container"
        yield AccessFinding(("bind", "propagation"), message, "remove it")
