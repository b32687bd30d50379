"""Removes a service's access to the host: hardware, privileges, names, ports, restarts."""

from collections.abc import Callable, Collection
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import rig_ports
from dodo_dsl.application.access.compose_keys import BELOW, SERVICE, removed
from dodo_dsl.application.access.nested_keys import mappings
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

_REMOVED = {key: why for key, why in removed(SERVICE).items() if key != "scale"}
_REFUSED = [key for key, (treatment, _) in SERVICE.items() if treatment == "refused"]
"""Keys that a copy has only where they ask for nothing."""


def remove_machine_settings(copy: ServiceCopy) -> None:
    """Removes names, ports and policies; each service of a test runs once."""
    for key, why in _REMOVED.items():
        copy.remove(key, why)
    for key in _REFUSED:
        copy.remove(key, "it asks for nothing")
    _note_replicas(copy)
    for path, rows in BELOW.items():
        for _, below in list(mappings(copy.service, path)):
            own = [key for key in below if key.startswith("x-")] if path == "build" else []  # builders take x-bake
            _remove_below(copy, path, below, (*removed(rows), *own))
    if not copy.service.get("deploy", True):
        copy.service.pop("deploy")


def _note_replicas(copy: ServiceCopy) -> None:
    scale, deploy = copy.service.pop("scale", None), copy.service.get("deploy")
    scale = deploy.get("replicas", scale) if isinstance(deploy, dict) else scale
    if str(scale) not in ("None", "1"):
        copy.note(f"starts once, not {scale} times")


def _remove_below(copy: ServiceCopy, path: str, mapping: dict[str, Any], keys: Collection[str]) -> None:
    taken = [key for key in mapping if key in keys]
    for key in taken:
        del mapping[key]
    if taken:
        copy.note(f"{', '.join(taken)} removed from {path.removesuffix('.*')}")


def remove_hardware(copy: ServiceCopy) -> None:
    """Removes devices without a rig, and privileges unless the rig allows them."""
    service, setting = copy.service, copy.setting
    if not setting.keeps_privileges:
        if host_access.is_true(service.get("privileged", False)):
            copy.remove("privileged")
        service.pop("privileged", None)
        _remove_capabilities(copy)
        _remove_unconfined(copy)
        build = service.get("build")
        if isinstance(build, dict):
            _remove_below(copy, "build", build, ("privileged",))
    _remove_ports(copy)
    if setting.hil:
        return
    for key in host_access.HARDWARE_KEYS:
        copy.remove(key, "the test has no hardware")
    kept = []
    for volume in service.get("volumes") or ():
        found = host_access.mount(copy.filled(volume))
        if host_access.is_hardware(found):
            copy.note(f"volumes: {found.source} removed, the test has no hardware")
        else:
            kept.append(volume)
    copy.keep_items("volumes", kept)


def _remove_ports(copy: ServiceCopy) -> None:
    """The ports of rigs, which their own services open."""
    ports = copy.setting.ports
    tests: dict[str, Callable[[Any], bool]] = {
        "devices": lambda word: rig_ports.holds_port(rig_ports.source(word), ports),
        "device_cgroup_rules": lambda word: rig_ports.is_rule_for_port(word, ports),
        "volumes": lambda word: rig_ports.is_port(host_access.mount(word).source, ports),
    }
    for key, leads in tests.items():
        words = copy.service.get(key)
        if isinstance(words, list) and (taken := [word for word in words if leads(copy.filled(word))]):
            copy.note(f"{key}: the rig's port removed")
            copy.keep_items(key, [word for word in words if word not in taken])


def _remove_capabilities(copy: ServiceCopy) -> None:
    words = copy.service.get("cap_add") or []
    kept = [word for word in words if host_access.is_harmless_capability(copy.filled(word))]
    copy.keep_items("cap_add", kept)
    if taken := [str(word) for word in words if word not in kept]:
        copy.note(f"cap_add: removed {', '.join(taken)}")


def _remove_unconfined(copy: ServiceCopy) -> None:
    words = copy.service.get("security_opt") or []
    kept = [word for word in words if host_access.is_confining(copy.filled(word))]
    copy.keep_items("security_opt", kept)
    if len(kept) < len(words):
        copy.note("security_opt keeps the engine's confinement")
