"""Limits and confinement of a service: what it has unless its file sets less, and what it never has."""

from typing import Any

from dodo_dsl.application.access.limit_findings import Excess, service_excesses
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

DROPPED = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT")
"""Capabilities that engines give by default and no OpenDLV program needs: to send as another container, for example.

What a program that starts as root needs to give up root, it keeps.
"""
LOGS = {"max-size": "50m", "max-file": "2"}
"""What is kept of a service's log: two files of 50 MB."""
_DRIVERS = ("json-file", "local")
_NUMBERS = ("pids_limit", "mem_limit", "cpus", "pids", "memory")
_UNLIMITED = ("", "0", "-1")


def confine(copy: ServiceCopy) -> None:
    """Limits of processes, memory and files, no way to more privileges, logs that DoDo reads."""
    limits = copy.setting.limits
    _cut(copy)
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


def _cut(copy: ServiceCopy) -> None:
    """Puts the test's limits in the place of what goes beyond them."""
    for excess in list(service_excesses(copy.filled(copy.service), copy.setting.limits)):
        if not _is_removed(copy, excess):
            put(copy.service, excess)
        copy.note(f"{excess.shown} is {excess.allowed}")


def _is_removed(copy: ServiceCopy, excess: Excess) -> bool:
    """Whether a number was removed that sets no limit: ``_limit`` puts the default where compose wants it."""
    *way, last = excess.steps
    holder: Any = copy.service
    for step in way:
        holder = holder.get(step) if isinstance(holder, dict) else None
    if last not in _NUMBERS or str(copy.filled(holder[last])).strip() not in _UNLIMITED:
        return False
    del holder[last]
    return True


def put(written: Any, excess: Excess) -> None:
    """Changes a plain value in place, so that it has what is allowed."""
    *way, last = excess.steps
    for step in way:
        if isinstance(written, dict) and not isinstance(written.get(step), dict | list):
            written[step] = {}
        written = written[step]
    written[last] = excess.allowed


def _limit_logs(copy: ServiceCopy) -> None:
    """The newest part of a log, unless the file itself says how much: an engine keeps all."""
    logging = copy.service.get("logging")
    logging = logging if isinstance(logging, dict) else {}
    options = logging.get("options")
    options = options if isinstance(options, dict) else {}
    if str(copy.filled(options.get("max-size") or "")).strip() in _UNLIMITED:
        driver = logging.get("driver") or _DRIVERS[0]
        copy.service["logging"] = {**logging, "driver": driver, "options": {**options, **LOGS}}


def _limit(copy: ServiceCopy, key: str, word: str, default: float) -> None:
    """A limit as the file has it, else the default: below ``deploy`` where limits are set there, as compose wants."""
    limits: Any = copy.service.get("deploy")
    for part in ("resources", "limits"):
        limits = limits.get(part) if isinstance(limits, dict) else None
    if copy.service.get(key) is not None or (isinstance(limits, dict) and limits.get(word) is not None):
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
        copy.note("ulimits.nproc removed, as it counts the user's processes on the whole machine: pids_limit counts")
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
