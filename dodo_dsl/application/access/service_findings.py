"""What a service of a compose file may not have, found in its plain values with their variables filled in."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import rig_ports
from dodo_dsl.application.access.build_findings import build_findings
from dodo_dsl.application.access.compose_keys import SERVICE
from dodo_dsl.application.access.host_paths import ASK, HostPaths
from dodo_dsl.application.access.limit_findings import limit_findings
from dodo_dsl.application.access.model import AccessFinding, Steps, key_findings
from dodo_dsl.application.access.mount_findings import mount_findings
from dodo_dsl.application.access.nested_keys import nested_findings, removed_findings
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

PROFILE_HINT = "give the service a profile, so that it starts with 'docker compose --profile' and not in a test"
RUNTIMES = ("nvidia", "runc", "runsc")
HOOKS = ("pre_start", "post_start", "pre_stop")
_WITHOUT = "is left out of sil and dil tests, which have no hardware"
_CDI = "is a description of the host, which can mount anything"
_GRAPHICS = ("", "nvidia", "amd")
_RESERVED: Steps = ("deploy", "resources", "reservations", "devices")
_RULE_OF_CHARACTERS = re.compile(r"c [0-9*]+:[0-9*]+ [rwm]+")


@dataclass(frozen=True)
class Surroundings:
    """What a service's values are judged by: the host's paths, and the application's containers and volumes.

    ``compiled`` tells that the service is a test's copy, from which much has been removed. ``ports`` are those of rigs.
    ``limits`` are the highest that the service may set.
    """

    paths: HostPaths
    containers: Mapping[str, str] = field(default_factory=dict)
    volumes: Mapping[str, Any] = field(default_factory=dict)
    compiled: bool = False
    ports: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)


def service_findings(name: str, service: dict[str, Any], around: Surroundings) -> Iterator[AccessFinding]:
    """Everything that ``service`` may not have; ``name`` is how messages call it."""
    yield from key_findings(f"'{name}'", _WITHOUT_SPECIAL, service, around.compiled)
    yield from nested_findings(name, service, around.compiled)
    yield from removed_findings(name, service) if around.compiled else ()
    yield from _namespaces(service, around)
    yield from mount_findings(name, service, around.paths, around.volumes, around.ports, around.compiled)
    yield from _strangers(service, around)
    yield from _files(service, around.paths)
    yield from _hardware(name, service, around)
    yield from limit_findings(name, service, around.limits, around.compiled)
    yield from _confinement(name, service)
    yield from _hooks(name, service)
    if service.get("build") is not None:
        yield from (f.below("build") for f in build_findings(name, service, around.paths))


_WITHOUT_SPECIAL = {key: row for key, row in SERVICE.items() if key not in ("use_api_socket", "external_links")} | {
    "use_api_socket": ("kept", ""),
    "external_links": ("kept", ""),
}


def _namespaces(service: dict[str, Any], around: Surroundings) -> Iterator[AccessFinding]:
    for key in host_access.NAMESPACES:
        kind, name = host_access.reference(service.get(key))
        if kind == "container" and name not in around.containers:
            yield AccessFinding((key,), f"'{key}' joins the container '{name}', which is not part of the application")
    if service.get("pid") == "host":
        yield AccessFinding(("pid",), "'pid: host' gives access to the processes of all tests", "remove it")
    if host_access.is_true(service.get("use_api_socket", False)):
        yield AccessFinding(("use_api_socket",), "'use_api_socket' gives access to the Docker engine", PROFILE_HINT)
    runtime = str(service.get("runtime") or "")
    if runtime and "$" not in runtime and runtime not in RUNTIMES:
        message = f"the runtime '{runtime}' may not isolate the container"
        yield AccessFinding(("runtime",), message, f"remove it, or use one of {', '.join(RUNTIMES)}")


def _strangers(service: dict[str, Any], around: Surroundings) -> Iterator[AccessFinding]:
    for item, link in enumerate(_items(service.get("external_links"))):
        message = f"'{link}' is a container outside the application"
        yield AccessFinding(("external_links", item), message, "make it a service of the application")
    for item, entry in enumerate(_items(service.get("volumes_from"))):
        kind, name, _ = host_access.borrowed(entry)
        if kind == "container" and name not in around.containers:
            message = f"the container '{name}' is not part of the application"
            yield AccessFinding(("volumes_from", item), message, "make it a service of the application")


def _files(service: dict[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    written = service.get("env_file")
    for item, entry in enumerate(_items(written)):
        path = entry.get("path") if isinstance(entry, dict) else entry
        if isinstance(path, str) and (problem := paths.file_problem(path)):
            steps = ("env_file", item, "path") if isinstance(entry, dict) else ("env_file", item)
            yield AccessFinding(steps, problem, ASK)


def _hardware(name: str, service: dict[str, Any], around: Surroundings) -> Iterator[AccessFinding]:
    if host_access.is_true(service.get("privileged", False)):
        yield AccessFinding(("privileged",), f"'privileged' of '{name}' {_WITHOUT}", kind="privilege")
    yield from _devices(name, service, around)
    for item, word in enumerate(_items(service.get("cap_add"))):
        if not host_access.is_harmless_capability(word):
            yield AccessFinding(("cap_add", item), f"capability '{word}' of '{name}' {_WITHOUT}", kind="privilege")


def _devices(name: str, service: dict[str, Any], around: Surroundings) -> Iterator[AccessFinding]:
    ports = around.ports
    for item, word in enumerate(_items(service.get("devices"))):
        shown = word.get("source") if isinstance(word, dict) else word
        steps = ("devices", item, "source") if isinstance(word, dict) else ("devices", item)
        source = rig_ports.source(word)
        if link := around.paths.link(source):
            message = f"device '{shown}' is a symbolic link to '{link}', outside the repository"
            yield AccessFinding(steps, message, "name the device itself")
        elif "=" in source and not source.startswith("/"):
            yield AccessFinding(steps, f"device '{shown}' {_CDI}", "name a file below /dev")
        elif host_access.is_of_machine(shown) or any(map(host_access.is_of_machine, around.paths.names(source))):
            message = f"device '{shown}' gives access to the host's disks or memory"
            yield AccessFinding(steps, message, "remove it")
        elif rig_ports.holds_port(rig_ports.source(word), ports):
            yield _port(steps, f"device '{shown}' of '{name}'")
        else:
            yield AccessFinding(steps, f"device '{shown}' of '{name}' {_WITHOUT}", kind="hardware")
    yield from _processors(name, service)
    for item, word in enumerate(_items(service.get("device_cgroup_rules"))):
        steps = ("device_cgroup_rules", item)
        if rig_ports.is_rule_for_port(word, ports):
            yield _port(steps, f"rule '{word}' of '{name}'")
        elif "$" in str(word) or _RULE_OF_CHARACTERS.fullmatch(str(word)):
            yield AccessFinding(steps, f"device '{word}' of '{name}' {_WITHOUT}", kind="hardware")
        else:
            message = f"the rule '{word}' gives access to the host's disks"
            yield AccessFinding(steps, message, "name character devices, for example c 81:* rw")


def _processors(name: str, service: dict[str, Any]) -> Iterator[AccessFinding]:
    """Requests of graphics processors that ask for other devices."""
    reserved: Any = service.get("deploy")
    for key in ("resources", "reservations", "devices"):
        reserved = reserved.get(key) if isinstance(reserved, dict) else None
    for way, written in ((("gpus",), service.get("gpus")), (_RESERVED, reserved)):
        for item, request in enumerate(written if isinstance(written, list) else ()):
            driver = str(request.get("driver") or "") if isinstance(request, dict) else ""
            if driver.lower() not in _GRAPHICS and "$" not in driver:
                message = f"the driver '{driver}' of a device of '{name}' {_CDI}"
                yield AccessFinding((*way, item, "driver"), message, "use nvidia, or no driver")
            ids = request.get("device_ids") if isinstance(request, dict) else None
            for number, word in enumerate(_items(ids)):
                if "=" in str(word):
                    message = f"device '{word}' of '{name}' {_CDI}"
                    yield AccessFinding((*way, item, "device_ids", number), message, "use numbers, or UUIDs of GPUs")


def _port(steps: Steps, what: str) -> AccessFinding:
    return AccessFinding(steps, f"{what} {rig_ports.WHY}", rig_ports.HINT, "port")


def _confinement(name: str, service: dict[str, Any]) -> Iterator[AccessFinding]:
    for item, word in enumerate(_items(service.get("security_opt"))):
        if not host_access.is_confining(word):
            message = f"'{word}' of '{name}' is left out, the engine's own confinement stays"
            yield AccessFinding(("security_opt", item), message, kind="left out")


def _hooks(name: str, service: dict[str, Any]) -> Iterator[AccessFinding]:
    for key in HOOKS:
        for item, hook in enumerate(_items(service.get(key))):
            if isinstance(hook, dict) and host_access.is_true(hook.get("privileged", False)):
                message = f"a privileged '{key}' of '{name}' reaches the host"
                yield AccessFinding((key, item, "privileged"), message, "remove it")


def _items(written: Any) -> list[Any]:
    """A list, or the single value written instead of one."""
    if written is None:
        return []
    return written if isinstance(written, list) else [written]
