"""Removes a service's access to the host: hardware, privileges, names, ports, restarts."""

from collections.abc import Callable, Collection
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import rig_ports
from dodo_dsl.application.access.compose_keys import BUILD, SERVICE, removed
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

_REMOVED = {key: why for key, why in removed(SERVICE).items() if key != "scale"}
_DEPLOY = ("labels", "replicas", "mode", "restart_policy", "placement", "update_config", "rollback_config")


def remove_machine_settings(copy: ServiceCopy) -> None:
    """Removes names, ports and policies; each service of a test runs once."""
    for key, why in _REMOVED.items():
        copy.remove(key, why)
    build = copy.service.get("build")
    if isinstance(build, dict):
        own = [key for key in build if key.startswith("x-")]  # builders take x-bake for theirs
        _remove_from_build(copy, build, (*removed(BUILD), *own))
    scale, deploy = copy.service.pop("scale", None), copy.service.get("deploy")
    if isinstance(deploy, dict):
        scale = deploy.get("replicas", scale)
        kept = {key: value for key, value in deploy.items() if key not in _DEPLOY}
        if len(kept) < len(deploy):
            copy.note("deploy keeps only resources")
        copy.service["deploy"] = kept
        _remove_reserved_memory(copy, kept)
        if not kept:
            copy.service.pop("deploy")
    if scale not in (None, 1):
        copy.note(f"starts once, not {scale} times")


def _remove_reserved_memory(copy: ServiceCopy, deploy: dict[str, Any]) -> None:
    """The engine refuses one above the limit, which a test sets."""
    resources = deploy.get("resources")
    reserved = resources.get("reservations") if isinstance(resources, dict) else None
    if isinstance(reserved, dict) and reserved.pop("memory", None) is not None:
        copy.note("reserved memory removed, a test has limits only")


def _remove_from_build(copy: ServiceCopy, build: dict[str, Any], keys: Collection[str]) -> None:
    taken = [key for key in build if key in keys]
    if taken:
        copy.service["build"] = {key: value for key, value in build.items() if key not in keys}
        copy.note(f"{', '.join(taken)} removed from build")


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
            _remove_from_build(copy, build, ("privileged",))
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
