"""What a service may not have is removed as the tables say, and it has the test's limits unless it sets less."""

from collections.abc import Collection
from dataclasses import replace
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access.compose_keys import BELOW, SERVICE, removed
from dodo_dsl.application.access.limit_findings import UNLIMITED, dotted, put, service_limits
from dodo_dsl.application.access.model import Access, AccessFinding, Kind, at, items, mapping_findings, mappings
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

DROPPED = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT")
"""Capabilities that engines give by default and no OpenDLV program needs: to send as another container, for example.

What a program that starts as root needs to give up root, it keeps.
"""
LOGS = {"max-size": "50m", "max-file": "2"}
"""What is kept of a service's log: two files of 50 MB."""
_DRIVERS = ("json-file", "local")
_NUMBERS = ("pids_limit", "mem_limit", "cpus", "pids", "memory")
_PORTS = ("devices", "device_cgroup_rules", "volumes")
"""Keys by which a service could have a rig's port."""


def remove_machine_settings(copy: ServiceCopy) -> None:
    """Removes names, ports and policies; each service of a test runs once."""
    for key, why in removed(SERVICE).items():
        if key != "scale":
            copy.remove(key, why)
    for key, row in sorted(SERVICE.items()):
        if row.treatment == "refused":
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
    """Removes what is found of privileges, rigs' ports and hardware, as far as the test's rig does not allow it."""
    service, setting = copy.service, copy.setting
    access, before = Access(devices=setting.hil, privileged=setting.privileged_allowed), dict(service)
    look = replace(copy.project.look, name=copy.name)
    every = mapping_findings(copy.name, SERVICE, copy.filled(service), look)
    found = [finding for finding in every if not access.allows(finding.kind)]

    def take(key: str, kind: Kind) -> list[Any]:
        """Removes the items of a list, or its single value, in which there was something of the kind; returns them."""
        numbers = {f.steps[1] for f in found if f.steps[0] == key and f.kind == kind and len(f.steps) > 1}
        taken = [item for (_, number), item in items(before, key) if number in numbers]
        if taken:
            copy.keep_items(key, [item for _, item in items(service, key) if item not in taken])
        return taken

    if not setting.keeps_privileges:
        if host_access.is_true(service.get("privileged", False)):
            copy.remove("privileged")
        service.pop("privileged", None)
        if taken := take("cap_add", "privilege"):
            copy.note(f"cap_add: removed {', '.join(map(str, taken))}")
        if take("security_opt", "left out"):
            copy.note("security_opt keeps the engine's confinement")
        if isinstance(service.get("build"), dict):
            _remove_below(copy, "build", service["build"], ("privileged",))
    for key in _PORTS:
        if take(key, "port"):
            copy.note(f"{key}: the rig's port removed")
    if not setting.hil:
        for key in host_access.HARDWARE_KEYS:
            copy.remove(key, "the test has no hardware")
        for volume in take("volumes", "hardware"):
            source = host_access.mount(copy.filled(volume)).source
            copy.note(f"volumes: {source} removed, the test has no hardware")


def confine(copy: ServiceCopy) -> None:
    """Limits of processes, memory and files, no more privileges, logs that DoDo reads."""
    limits = copy.setting.limits
    for finding in list(service_limits(copy.filled(copy.service), limits)):
        if not _is_removed(copy, finding):
            put(copy.service, finding)
        copy.note(f"{dotted(finding.steps)} is {finding.allowed}")
    _limit(copy, "pids_limit", "pids", limits.processes)
    _limit(copy, "mem_limit", "memory", limits.memory)
    if limits.cpus is not None and "cpu_quota" not in copy.service:
        _limit(copy, "cpus", "cpus", limits.cpus)
    _limit_files(copy)
    if not copy.setting.keeps_privileges:
        _drop_capabilities(copy)
        _keep_privileges_down(copy)
    logging = copy.filled(copy.service.get("logging"))
    if isinstance(logging, dict) and logging.get("driver", "json-file") not in _DRIVERS:
        copy.remove("logging", "DoDo reads the logs")
    _limit_logs(copy)


def _is_removed(copy: ServiceCopy, finding: AccessFinding) -> bool:
    """Whether a number was removed that sets no limit: ``_limit`` puts the default where compose wants it."""
    *way, last = finding.steps
    holder = at(copy.service, tuple(way))
    if last not in _NUMBERS or str(copy.filled(holder[last])).strip() not in UNLIMITED:
        return False
    del holder[last]
    return True


def _limit_logs(copy: ServiceCopy) -> None:
    """The newest part of a log, unless the file itself says how much: an engine keeps all."""
    logging = copy.service.get("logging")
    logging = logging if isinstance(logging, dict) else {}
    options = logging.get("options")
    options = options if isinstance(options, dict) else {}
    if str(copy.filled(options.get("max-size") or "")).strip() in UNLIMITED:
        driver = logging.get("driver") or _DRIVERS[0]
        copy.service["logging"] = {**logging, "driver": driver, "options": {**options, **LOGS}}


def _limit(copy: ServiceCopy, key: str, word: str, default: float) -> None:
    """A limit as the file has it, else the default: below ``deploy`` where limits are set there, as compose wants."""
    limits = at(copy.service, ("deploy", "resources", "limits"))
    if copy.service.get(key) is not None or at(limits, (word,)) is not None:
        return
    copy.service.pop(key, None)
    if isinstance(limits, dict):
        limits[word] = default if word == "pids" else str(default)
    else:
        copy.service[key] = default


def _limit_files(copy: ServiceCopy) -> None:
    """The size of a file in bytes, files that are open, and no core dumps, unless the service sets lower ones."""
    own, limits = copy.service.get("ulimits"), copy.setting.limits
    if isinstance(own, dict) and own.pop("nproc", None) is not None:
        copy.note(
            "ulimits.nproc removed, because it counts the user's processes on the whole machine: pids_limit counts"
        )
    most = {"core": 0, "fsize": limits.file_size, "nofile": limits.files}
    copy.service["ulimits"] = most | (own if isinstance(own, dict) else {})


def _keep_privileges_down(copy: ServiceCopy) -> None:
    """Programs such as sudo gain nothing, unless the service says that they do."""
    own = list(copy.service.get("security_opt") or ())
    if not any(str(copy.filled(word)).startswith("no-new-privileges") for word in own):
        copy.service["security_opt"] = [*own, "no-new-privileges:true"]


def _drop_capabilities(copy: ServiceCopy) -> None:
    dropped = [str(word) for word in copy.service.get("cap_drop") or ()]
    taken = {word.upper().removeprefix("CAP_") for word in dropped}
    copy.service["cap_drop"] = [*dropped, *(name for name in DROPPED if not taken & {name, "ALL"})]
