"""What a container may have of its machine: limits, cut to those of ``sandbox`` in ``dodo.yml``; a rig's hardware."""

import copy
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application.host_paths import is_port
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.model import is_true, plain
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Node

if TYPE_CHECKING:
    from dodo_dsl.application.container import Container

_DROPPED = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SYS_CHROOT")
"""Capabilities that engines give by default and no OpenDLV program needs: to send as another container, for example."""
_CAPABILITIES = frozenset(
    ("AUDIT_WRITE", "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "IPC_LOCK", "KILL", "NET_BIND_SERVICE", "SETFCAP",
     "SETGID", "SETPCAP", "SETUID", "SYS_CHROOT", "SYS_NICE", "SYS_PTRACE")
)  # fmt: skip
"""Capabilities that stay within a container; with others it reaches the host, or speaks for other containers."""
_SIZE = re.compile(r"\s*(\d{1,20}(?:\.\d{0,20})?)\s*([kmgtp]?)(?:i?b)?\s*", re.IGNORECASE | re.ASCII)
_OF_SANDBOX = {"fsize": "file-size", "nofile": "files", "memlock": "memory"}
_MESSAGE_QUEUES = 819_200
"""The kernel's default, in bytes (RLIMIT_MSGQUEUE)."""
_TMPFS_OPTIONS = re.compile(r"(mode|uid|gid)=\w+|nosuid|nodev|noexec|exec|rw|ro|noatime")
LOGS = {"driver": "json-file", "options": {"max-size": "50m", "max-file": "2"}}
"""What is kept of a service's log: two files of 50 MB."""
_NO_PORT = "is left out of all tests: only the service that moves the rig opens its port"
_WITHOUT_HARDWARE = "is left out of sil and dil tests, which have no hardware"


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
    found = number(value)
    return math.floor(found) if math.isfinite(found) else found


def capped(
    c: "Container", node: Node, what: str, most: float, key: str, measure: Callable[[object], float], least: float = 1
) -> float:
    """A limit of at most ``most``, which also takes the place of none; ``key`` of ``sandbox`` sets it, if one does."""
    written = c.literal(node)
    found = measure(written)
    if math.isinf(found) and written and not written.startswith("-"):
        c.bad(node.span, f"'{written}' is not a limit, expected a number")
    elif found > most and written is not None:
        c.cut(node.span, what, most, key)
    value = found if least <= found <= most else most
    return int(value) if float(value).is_integer() else value


def ulimits(c: "Container", node: Node | None = None) -> dict[str, Any]:
    """Highest limits of a process, those of the test and no core dumps where it sets none.

    ``nproc`` counts the user's processes on the whole machine, so that ``pids_limit`` takes its place.
    """
    own = {"core": 0, "fsize": c.limits.file_size, "nofile": c.limits.files}
    made: dict[str, Any] = dict(own)
    most = {**own, "memlock": c.limits.memory, "msgqueue": _MESSAGE_QUEUES}

    def cut(name: str, part: str, value: Node) -> float:
        key = _OF_SANDBOX.get(name, "")
        found = capped(c, value, f"ulimits.{name}{part}", most.get(name, math.inf), key, whole, 0)
        return found if math.isfinite(found) else -1

    for name, entry in source.entries(node).items():
        if isinstance(entry.value, source.Mapping):
            parts = {part: each.value for part, each in entry.value.entries.items() if part in ("soft", "hard")}
            made[name] = {part: cut(name, f".{part}", value) for part, value in parts.items()}
        else:
            made[name] = cut(name, "", entry.value)
    made.pop("nproc", None)
    return made


def deploy(c: "Container", node: Node) -> Any:
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
        if own.get(key) in (None, math.inf):
            own.pop(key, None)
            own.update({} if value is None else {key: value})
    if "ulimits" not in own:
        own["ulimits"] = ulimits(c)
    if not c.project.setting.keeps_privileges:
        own.setdefault("security_opt", ["no-new-privileges:true"])
        dropped = [str(word) for word in own.get("cap_drop") or ()]
        taken = {word.upper().removeprefix("CAP_") for word in dropped}
        own["cap_drop"] = [*dropped, *(name for name in _DROPPED if not taken & {name, "ALL"})]
    own["logging"] = copy.deepcopy(LOGS)


LIMITS: dict[str, Callable[["Container", Node], Any]] = {
    "cpus": lambda c, n: capped(c, n, "cpus", c.limits.cpus or math.inf, "cpus", number, 1e-9),
    "mem_limit": lambda c, n: capped(c, n, "mem_limit", c.limits.memory, "memory", size),
    "pids_limit": lambda c, n: capped(c, n, "pids_limit", c.limits.processes, "processes", whole),
    "shm_size": lambda c, n: capped(c, n, "shm_size", c.limits.memory, "memory", size),
}


def is_kept(c: "Container", span: Span, called: str, is_of_rig: bool) -> bool:
    """Whether a test has a device of the host: a rig's, but for its port; with a problem where it has not."""
    if is_of_rig:
        c.hardware(span, f"{called} of '{c.name}' {_NO_PORT}", "give the application another device")
    elif c.project.setting.hil:
        return True
    else:
        c.hardware(span, f"{called} of '{c.name}' {_WITHOUT_HARDWARE}")
    return False


def devices(c: "Container", node: Node) -> Any:
    made, paths = [], c.project.paths
    for item in c.items(node):
        about = item.get("source") if isinstance(item, source.Mapping) else item
        if about is None or not (word := c.literal(about)):
            continue
        path = word.partition(":")[0]
        if not paths.is_hardware(path):
            c.refuse(about.span, f"device '{word}' of '{c.name}' is none of a robot, but of the host", "remove it")
        elif is_kept(c, about.span, f"device '{word}'", is_port(paths.whole(path), c.project.ports, within=True)):
            made.append(plain(item))
    return made or None


def privileged(c: "Container", node: Node) -> Any:
    found = _allowed(c, node, lambda word: not is_true(word), "'privileged'")
    return True if found and is_true(found[0]) else None


def capabilities(c: "Container", node: Node) -> Any:
    return _allowed(c, node, lambda word: word.upper().removeprefix("CAP_") in _CAPABILITIES, "capability '{}'") or None


def _allowed(c: "Container", node: Node, is_harmless: Callable[[str], bool], called: str) -> list[str]:
    """The texts that a container may have: those that are harmless, and all on a rig that allows privileges."""
    made = []
    for item in c.items(node):
        if not (word := c.literal(item)):
            continue
        if is_harmless(word) or c.project.setting.keeps_privileges:
            made.append(word)
        else:
            c.hardware(item.span, f"{called.format(word)} of '{c.name}' {_WITHOUT_HARDWARE}")
    return made


def gpus(c: "Container", node: Node) -> Any:
    """Requests of NVIDIA's graphics processors: ``all``, or the devices of a reservation."""
    made = []
    for item in c.items(node):
        if not isinstance(item, source.Mapping):
            return plain(item)
        fields = c.fields(
            item, f"a graphics processor of '{c.name}'", "driver count device_ids capabilities", "options"
        )
        drivers, ids = ([*c.items(fields[key])] if key in fields else [] for key in ("driver", "device_ids"))
        wrong = [word for word in drivers if c.literal(word) not in ("", "nvidia")]
        wrong += [word for word in ids if "=" in (c.literal(word) or "")]
        if wrong:
            hint = "use numbers or UUIDs of GPUs, and nvidia or no driver"
            c.refuse(wrong[0].span, f"'{plain(wrong[0])}' of '{c.name}' may be any device of the host", hint)
        else:
            made.append({key: plain(value) for key, value in fields.items()})
    return made or None
