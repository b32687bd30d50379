"""Limits of a service: what it sets itself, cut to those of ``sandbox`` in ``dodo.yml``."""

import copy
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application.compose_paths import escaped
from dodo_dsl.application.hardware import gpus
from dodo_dsl.source import Node

if TYPE_CHECKING:
    from dodo_dsl.application.container import Container

_DROPPED = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT")
"""Capabilities that engines give by default and no OpenDLV program needs: to send as another container, for example."""
_SIZE = re.compile(r"\s*(\d{1,20}(?:\.\d{0,20})?)\s*([kmgtp]?)(?:i?b)?\s*", re.IGNORECASE | re.ASCII)
_OF_SANDBOX = {"fsize": "file-size", "nofile": "files", "memlock": "memory"}
_MESSAGE_QUEUES = 819_200
"""The kernel's default, in bytes (RLIMIT_MSGQUEUE)."""
_TMPFS_OPTIONS = re.compile(r"(mode|uid|gid)=\w+|nosuid|nodev|noexec|exec|rw|ro|noatime")
LOGS = {"driver": "json-file", "options": {"max-size": "50m", "max-file": "2"}}
"""What is kept of a service's log: two files of 50 MB."""


def size(value: object) -> float:
    """Bytes of a size as compose reads it, ``8g``; infinite where it is none."""
    found = _SIZE.fullmatch(str(value))
    return math.floor(float(found[1]) * 1024.0 ** " kmgtp".index(found[2].lower() or " ")) if found else math.inf


def number(value: object) -> float:
    """A number as compose reads it; infinite where it is none, or below 0."""
    try:
        found = float(str(value))
    except ValueError:
        return math.inf
    return found if found >= 0 else math.inf


def whole(value: object) -> float:
    """A whole number, as compose reads it."""
    found = number(value)
    return math.floor(found) if math.isfinite(found) else found


def limit(
    c: "Container", node: Node, most: float, what: str, key: str, measure: Callable[[object], float] = number
) -> float:
    """A limit of at most ``most``, which also takes the place of 0 and below."""
    found = measure(c.literal(node))
    if math.isfinite(found) and found > most:
        c.cut(node.span, what, most, key)
    value = found if 0 < found <= most and math.isfinite(found) else most
    return int(value) if float(value).is_integer() else value


def ulimits(c: "Container", node: Node | None = None) -> dict[str, Any]:
    """Highest limits of a process, those of the test and no core dumps where it sets none.

    ``nproc`` counts the user's processes on the whole machine, so that ``pids_limit`` takes its place.
    """
    own = {"core": 0, "fsize": c.limits.file_size, "nofile": c.limits.files}
    made: dict[str, Any] = dict(own)
    for name, entry in source.entries(node).items():
        most = {**own, "memlock": c.limits.memory, "msgqueue": _MESSAGE_QUEUES}.get(name, math.inf)
        if name == "nproc":
            continue
        if isinstance(entry.value, source.Mapping):
            parts = {part: each.value for part, each in entry.value.entries.items() if part in ("soft", "hard")}
            made[name] = {part: _ulimit(c, f"{name}.{part}", each, most) for part, each in parts.items()}
        else:
            made[name] = _ulimit(c, name, entry.value, most)
    return made


def _ulimit(c: "Container", name: str, node: Node, most: float) -> float | str | None:
    written = c.literal(node)
    if not math.isfinite(whole(written)) and written not in ("-1", None):
        c.bad(node.span, f"'{written}' is not a limit, expected a whole number or -1")
    if whole(written) <= most:
        return int(whole(written)) if math.isfinite(whole(written)) else -1
    c.cut(node.span, f"ulimits.{name}", most, _OF_SANDBOX.get(name.partition(".")[0], ""))
    return int(most)


def deploy(c: "Container", node: Node) -> Any:
    """Limits as those of the service, and reservations of graphics processors."""
    what = f"'deploy' of '{c.name}'"
    left = "endpoint_mode labels mode replicas rollback_config update_config placement restart_policy"
    resources = c.fields(c.fields(node, what, "resources", left).get("resources"), what, "limits reservations")
    own = c.fields(resources.get("limits"), what, "cpus memory pids")
    for key, name in (("cpus", "cpus"), ("memory", "mem_limit"), ("pids", "pids_limit")):
        if key in own:
            c.own[name] = LIMITS[name](c, own[key])
    reserved = c.fields(resources.get("reservations"), what, "devices", "cpus memory generic_resources")
    found = gpus(c, reserved["devices"]) if "devices" in reserved else None
    return {"resources": {"reservations": {"devices": found}}} if found else None


def tmpfs(c: "Container", node: Node) -> Any:
    """File systems in memory, each with a size; other options than those that are known stay out."""
    made, most = [], c.limits.memory
    for item in c.items(node):
        target, _, options = (c.literal(item) or "").partition(":")
        words = [word.strip() for word in options.split(",") if word.strip()]
        sizes = [word for word in words if word.startswith(("size=", "nr_blocks="))]
        wanted = [size(word.removeprefix("size=")) for word in sizes] or [most]
        if not all(0 < one <= most for one in wanted):
            c.cut(item.span, "tmpfs", most, "memory")
            wanted = [most]
        kept = [word for word in words if _TMPFS_OPTIONS.fullmatch(word)]
        made += [escaped(f"{target}:{','.join([*kept, f'size={int(wanted[-1])}'])}")] if target else []
    return made or None


def own_limits(c: "Container") -> None:
    own, most = c.own, c.limits
    for key, value in (("pids_limit", most.processes), ("mem_limit", most.memory), ("cpus", most.cpus)):
        if own.get(key) in (None, float("inf")):
            own.pop(key, None)
            own.update({} if value is None else {key: value})
    if "ulimits" not in own:
        own["ulimits"] = ulimits(c)
    if not c.project.setting.keeps_privileges:
        own["security_opt"] = ["no-new-privileges:true"]
        dropped = [str(word) for word in own.get("cap_drop") or ()]
        taken = {word.upper().removeprefix("CAP_") for word in dropped}
        own["cap_drop"] = [*dropped, *(name for name in _DROPPED if not taken & {name, "ALL"})]
    own["logging"] = copy.deepcopy(LOGS)


LIMITS: dict[str, Callable[["Container", Node], Any]] = {
    "cpus": lambda c, n: limit(c, n, math.inf if c.limits.cpus is None else c.limits.cpus, "cpus", "cpus"),
    "mem_limit": lambda c, n: limit(c, n, c.limits.memory, "mem_limit", "memory", size),
    "pids_limit": lambda c, n: limit(c, n, c.limits.processes, "pids_limit", "processes", whole),
    "shm_size": lambda c, n: limit(c, n, c.limits.memory, "shm_size", "memory", size),
}
