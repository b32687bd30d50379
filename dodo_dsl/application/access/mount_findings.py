"""What a service may not mount."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import rig_ports
from dodo_dsl.application.access.compose_keys import MOUNT
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import AccessFinding, Steps, key_findings

TYPES = ("bind", "volume", "tmpfs", "image")
_SHARED = ("shared", "rshared", "slave", "rslave")
_PRIVATE = ("private", "rprivate", "")
_SOCKET_HINT = "give the service a profile, so that it starts with 'docker compose --profile' and not in a test"
_WITHOUT = "is left out of sil and dil tests, which have no hardware"


def mount_findings(
    name: str,
    service: Mapping[str, Any],
    paths: HostPaths,
    volumes: Mapping[str, Any],
    ports: Sequence[str] = (),
    compiled: bool = False,
) -> Iterator[AccessFinding]:
    """Mounts of the host, of its hardware, of rigs' ``ports``, and of ``volumes`` that others use, too.

    A ``compiled`` test has none of the repository that can be written to.
    """
    written = service.get("volumes")
    for item, volume in enumerate(written if isinstance(written, list) else ()):
        found = host_access.mount(volume)
        steps: Steps = ("volumes", item)
        if isinstance(volume, dict):
            yield from (f.below(*steps) for f in _long_form(name, volume))
            steps = (*steps, "source") if "source" in volume else steps
        else:
            words = [word for word in host_access.mount_options(volume) if word in _SHARED]
            yield from (f.below(*steps) for f in _propagation(words, ()))
        if host_access.is_bind(volume, found.source):
            yield from (f.below(*steps) for f in _bind(name, found, paths, ports, compiled))
            continue
        about = volumes.get(found.source)
        if host_access.is_external(about) and not found.read_only:
            hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
            yield AccessFinding(steps, f"volume '{found.source}' is external, so tests would share it", hint)


def _bind(
    name: str, found: host_access.Mount, paths: HostPaths, ports: Sequence[str], compiled: bool
) -> Iterator[AccessFinding]:
    problem, hint = "", ""
    if paths.is_open(found.source):
        return
    every = [host_access.Mount(path, found.target, found.read_only) for path in paths.names(found.source)]
    if "\0" in found.source:
        problem, hint = paths.mount_problem(found.source)
    elif any(map(host_access.is_machine, every)):
        problem, hint = f"{_called(found.source, paths)} belongs to the host, so tests would share it", _SOCKET_HINT
    elif any(host_access.is_of_machine(seen.source) for seen in every):
        problem, hint = f"{_called(found.source, paths)} gives access to the host's disks or memory", "remove it"
    elif any(rig_ports.is_port(seen.source, ports) for seen in every):
        yield AccessFinding((), f"'{found.source}' of '{name}' {rig_ports.WHY}", rig_ports.HINT, "port")
    elif _is_hardware(found, every, paths):
        yield AccessFinding((), f"'{found.source}' of '{name}' {_WITHOUT}", kind="hardware")
    else:
        is_of_test = not compiled and host_access.is_token(found)
        problem, hint = ("", "") if is_of_test else paths.mount_problem(found.source)
        if compiled and not (problem or found.read_only or paths.is_writable(found.source)):
            problem = f"'{found.source}' is mounted to be written to"
    if problem:
        yield AccessFinding((), problem, hint)


def _is_hardware(found: host_access.Mount, every: Sequence[host_access.Mount], paths: HostPaths) -> bool:
    """Whether a whole path is hardware, also where its links lead; a link of the repository is none."""
    is_whole = found.source.startswith(("/", "~"))
    return is_whole and all(map(host_access.is_hardware, every)) and not paths.link(found.source)


def _called(source: str, paths: HostPaths) -> str:
    link = paths.link(source)
    return f"'{source}', a symbolic link to '{link}'," if link else f"'{source}'"


def _long_form(name: str, volume: dict[str, Any]) -> Iterator[AccessFinding]:
    yield from key_findings(f"a mount of '{name}'", MOUNT, volume)
    kind = str(volume.get("type", ""))
    if kind and "$" not in kind and kind not in TYPES:
        yield AccessFinding(("type",), f"mounts of type '{kind}' cannot be isolated", f"use one of {', '.join(TYPES)}")
    bind = volume.get("bind")
    if isinstance(bind, dict):
        yield from _propagation([str(bind.get("propagation") or "")], ("bind", "propagation"))


def _propagation(words: Sequence[str], steps: Steps) -> Iterator[AccessFinding]:
    for word in words:
        if word not in _PRIVATE and "$" not in word:
            yield AccessFinding(steps, f"propagation '{word}' lets mounts in and out of the container", "remove it")
