"""Network, IPC and other namespaces of a service: the test's own, or the rig's."""

from collections.abc import Collection
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.model import FILES, SANDBOX, environment
from dodo_dsl.plan.added_services import TIME, TIME_MOUNT, time_variables
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy


def own_namespaces(copy: ServiceCopy) -> None:
    """The namespaces of a test; references between the application's services stay."""
    for key in host_access.NAMESPACES:
        _own_reference(copy, key)
    if copy.setting.own_network:
        _own_network(copy)
    else:
        _host_network(copy)


def _own_reference(copy: ServiceCopy, key: str) -> None:
    """``container:x`` becomes ``service:x`` where x is a service of the application that starts."""
    kind, name = host_access.reference(copy.service.get(key))
    if kind == "container":
        name = copy.project.look.containers.get(name, "")
        copy.service[key] = f"service:{name}"
        copy.note(f"{key} is service:{name}")
    if kind and name not in copy.project.names:
        copy.remove(key, "that service does not start")


def _own_network(copy: ServiceCopy) -> None:
    service = copy.service
    mode = service.get("network_mode")
    stays = mode == "none" or host_access.reference(mode)[0] == "service"
    if not stays:
        copy.remove("network_mode", "the test has its own network")
    _own_names(copy, stays)
    if service.get("ipc") is not None:
        copy.note("ipc is the test's own")
    service["ipc"] = f"service:{SANDBOX}"


def _own_names(copy: ServiceCopy, stays: bool) -> None:
    """Removes ``networks``, but keeps the names that a service has there."""
    networks = copy.service.pop("networks", None)
    if networks is None:
        return
    about = networks.values() if isinstance(networks, dict) else ()
    names = list(dict.fromkeys(str(a) for n in about if isinstance(n, dict) for a in n.get("aliases") or ()))
    if names and not stays:
        copy.service["networks"] = {"default": {"aliases": names}}
    copy.note("networks removed, the test has its own network")


def _host_network(copy: ServiceCopy) -> None:
    service = copy.service
    mode = service.get("network_mode")
    if mode not in ("host", "none") and host_access.reference(mode)[0] != "service":
        service["network_mode"] = "host"
        copy.note("network_mode is host, as the rig's")
    if service["network_mode"] != "host":
        return
    for key in ("networks", "links"):
        copy.remove(key, "the network is the host's")
    sysctls = service.get("sysctls")
    if sysctls:
        copy.keep_items("sysctls", _without_network(sysctls))
        if service.get("sysctls") != sysctls:
            copy.note("sysctls of the host's network removed")


def _without_network(sysctls: Any) -> Any:
    if isinstance(sysctls, dict):
        return {key: value for key, value in sysctls.items() if not str(key).startswith("net.")}
    return [item for item in sysctls if not str(item).startswith("net.")]


def own_time(copy: ServiceCopy) -> None:
    """Its time is the test's: a library in its programs, and the processes where the agent sees them."""
    service, seed = copy.service, copy.setting.time_seed
    if seed is None or not copy.setting.own_network:
        return
    given = {name: value or "" for name, value in environment(service.get("environment")).items()}
    number = list(copy.project.names).index(copy.name)
    variables = time_variables(given, number, seed, f"{TIME_MOUNT}/libdodo-time.so")
    added = {name: value for name, value in variables.items() if given.get(name) != value}
    raw = service.get("environment") or {}
    if isinstance(raw, list):
        kept = [item for item in raw if str(item).partition("=")[0] not in added]
        service["environment"] = [*kept, *(f"{name}={value}" for name, value in added.items())]
    else:
        service["environment"] = {**raw, **added}
    service["pid"] = f"service:{SANDBOX}"
    mount = {"type": "volume", "source": TIME, "target": TIME_MOUNT, "read_only": True}
    service["volumes"] = [*(service.get("volumes") or []), mount]
    copy.note(f"environment: {', '.join(added)}, pid and a volume, as its time is the test's")


def own_dependencies(copy: ServiceCopy) -> None:
    """``depends_on`` of services that start, and of DoDo's that must be ready first."""
    service, setting, project = copy.service, copy.setting, copy.project
    raw = service.get("depends_on") or {}
    started = {"condition": "service_started"}
    own = {str(name): dict(started) for name in raw} if isinstance(raw, list) else dict(raw)
    for name in [name for name in own if name not in project.names]:
        copy.note(f"does not wait for {name}, which does not start")
        del own[name]
    waits = {name: {"condition": "service_healthy"} for name in setting.waits}
    if setting.own_network:
        waits = {SANDBOX: started, **waits}
    if project.copies is not None and _has_copies(service, project.copies.sources):
        waits = {FILES: {"condition": "service_healthy"}, **waits}
    service.pop("depends_on", None)
    if waits or own:
        service["depends_on"] = {**own, **waits}
    links = service.get("links") or []
    copy.keep_items("links", [link for link in links if str(link).partition(":")[0] in project.names])
    borrowed = [_borrowed(copy, entry) for entry in service.get("volumes_from") or ()]
    copy.keep_items("volumes_from", borrowed)


def _has_copies(service: dict[str, Any], copies: Collection[str]) -> bool:
    return any(host_access.mount(volume).source in copies for volume in service.get("volumes") or ())


def _borrowed(copy: ServiceCopy, entry: Any) -> Any:
    kind, name, options = host_access.borrowed(entry)
    return f"{copy.project.look.containers[name]}{options}" if kind == "container" else entry
