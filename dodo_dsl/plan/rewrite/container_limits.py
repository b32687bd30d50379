"""Limits and confinement of a service: what it has unless its file says so, and what it never has."""

from typing import Any

from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

DROPPED = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT")
"""Capabilities that engines give by default and no OpenDLV program needs: to send as another container, for example.

What a program that starts as root needs to give up root, it keeps.
"""
_DRIVERS = ("json-file", "local")
_RESERVED_LABELS = ("com.docker.", "dodo.")
_UNLIMITED = ("", "0", "-1")


def confine(copy: ServiceCopy) -> None:
    """Limits of processes, memory and files, no way to more privileges, logs that DoDo reads, labels of its own."""
    limits = copy.setting.limits
    _limit(copy, "pids_limit", "pids", limits.processes)
    _limit(copy, "mem_limit", "memory", limits.memory)
    _limit_files(copy, limits.file_size)
    if not copy.setting.keeps_privileges:
        _drop_capabilities(copy)
        _keep_privileges_down(copy)
    logging = copy.filled(copy.service.get("logging"))
    if isinstance(logging, dict) and logging.get("driver", "json-file") not in _DRIVERS:
        copy.remove("logging", "DoDo reads the logs")
    _own_labels(copy)


def _limit(copy: ServiceCopy, key: str, word: str, default: int) -> None:
    """A limit as the file has it, else the default: below ``deploy`` where limits are set there, as compose wants."""
    limits: Any = copy.service.get("deploy")
    for part in ("resources", "limits"):
        limits = limits.get(part) if isinstance(limits, dict) else None
    own, below = copy.service.get(key), limits.get(word) if isinstance(limits, dict) else None
    if _is_limit(copy.filled(own)) or (own is None and _is_limit(copy.filled(below))):
        return
    if own is not None or below is not None:
        copy.note(f"{key} is {default}")
    copy.service.pop(key, None)
    if isinstance(limits, dict):
        limits[word] = str(default) if word == "memory" else default
    else:
        copy.service[key] = default


def _is_limit(value: Any) -> bool:
    return value is not None and str(value).strip() not in _UNLIMITED


def _limit_files(copy: ServiceCopy, size: int) -> None:
    """The size of a file in bytes, and no core dumps, unless the service sets those."""
    own = copy.service.get("ulimits")
    copy.service["ulimits"] = {"core": 0, "fsize": size} | (own if isinstance(own, dict) else {})


def _keep_privileges_down(copy: ServiceCopy) -> None:
    """Programs such as sudo gain nothing, unless the service says that they do."""
    own = list(copy.service.get("security_opt") or ())
    if not any(str(copy.filled(word)).startswith("no-new-privileges") for word in own):
        copy.service["security_opt"] = [*own, "no-new-privileges:true"]


def _drop_capabilities(copy: ServiceCopy) -> None:
    dropped = [str(word) for word in copy.service.get("cap_drop") or ()]
    taken = {word.upper().removeprefix("CAP_") for word in dropped}
    copy.service["cap_drop"] = [*dropped, *(name for name in DROPPED if not taken & {name, "ALL"})]


def _own_labels(copy: ServiceCopy) -> None:
    labels = copy.service.get("labels")
    if isinstance(labels, dict):
        kept: Any = {key: value for key, value in labels.items() if not str(key).startswith(_RESERVED_LABELS)}
    elif isinstance(labels, list):
        kept = [label for label in labels if not str(label).startswith(_RESERVED_LABELS)]
    else:
        return
    if len(kept) < len(labels):
        copy.note("labels of compose and DoDo removed")
        copy.keep_items("labels", kept)
