"""Removes a service's access to the host: hardware, privileges, names, ports, restarts."""

from dodo_dsl.application import host_access
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

_REMOVED = {
    "container_name": "compose names the container",
    "restart": "containers are not restarted",
    "ports": "tests publish none",
    "cgroup_parent": "",
    "cgroup": "",
    "pull_policy": "DoDo manages images",
    "develop": "",
    "profiles": "",
    "extends": "",
}
_DEPLOY = ("replicas", "mode", "restart_policy", "placement", "update_config", "rollback_config")


def remove_machine_settings(copy: ServiceCopy) -> None:
    """Removes names, ports and policies; each service of a test runs once."""
    for key, why in _REMOVED.items():
        copy.remove(key, why)
    scale, deploy = copy.service.pop("scale", None), copy.service.get("deploy")
    if isinstance(deploy, dict):
        scale = deploy.get("replicas", scale)
        kept = {key: value for key, value in deploy.items() if key not in _DEPLOY}
        if len(kept) < len(deploy):
            copy.note("deploy keeps only resources and labels")
        copy.service["deploy"] = kept
        if not kept:
            copy.service.pop("deploy")
    if scale not in (None, 1):
        copy.note(f"starts once, not {scale} times")


def remove_hardware(copy: ServiceCopy) -> None:
    """Removes devices without a rig, and privileges unless the rig allows them."""
    service, setting = copy.service, copy.setting
    allowed = setting.hil and setting.privileged_allowed
    if not allowed:
        if host_access.is_true(service.get("privileged", False)):
            copy.remove("privileged")
        service.pop("privileged", None)
        _remove_capabilities(copy)
        _remove_unconfined(copy)
        build = service.get("build")
        if isinstance(build, dict) and "privileged" in build:
            service["build"] = {key: value for key, value in build.items() if key != "privileged"}
            copy.note("privileged removed from build")
    if setting.hil:
        return
    for key in host_access.HARDWARE_KEYS:
        copy.remove(key, "the test has no hardware")
    kept = []
    for volume in service.get("volumes") or ():
        found = host_access.mount(volume)
        if host_access.is_hardware(found):
            copy.note(f"{found.source} removed, the test has no hardware")
        else:
            kept.append(volume)
    copy.keep_items("volumes", kept)


def _remove_capabilities(copy: ServiceCopy) -> None:
    words = copy.service.get("cap_add") or []
    taken = [w for w in words if host_access.capability(w) in host_access.MACHINE_CAPABILITIES]
    copy.keep_items("cap_add", [w for w in words if w not in taken])
    if taken:
        copy.note(f"capabilities removed: {', '.join(map(str, taken))}")


def _remove_unconfined(copy: ServiceCopy) -> None:
    words = copy.service.get("security_opt") or []
    kept = [w for w in words if "unconfined" not in str(w)]
    copy.keep_items("security_opt", kept)
    if len(kept) < len(words):
        copy.note("security_opt keeps the engine's confinement")
