"""What a container may have of a machine: devices and privileges where a rig allows them, graphics processors."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application.host_paths import holds_port
from dodo_dsl.application.model import is_true, plain
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Node

if TYPE_CHECKING:
    from dodo_dsl.application.container import Container

_CAPABILITIES = frozenset(
    ("AUDIT_WRITE", "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "IPC_LOCK", "KILL", "NET_BIND_SERVICE", "SETFCAP",
     "SETGID", "SETPCAP", "SETUID", "SYS_CHROOT", "SYS_NICE", "SYS_PTRACE")
)  # fmt: skip
"""Capabilities that stay within a container; with others it reaches the host, or speaks for other containers."""
_NO_PORT = "is left out of all tests: only the service that moves the rig opens its port"
_WITHOUT_HARDWARE = "is left out of sil and dil tests, which have no hardware"


def is_kept(c: "Container", path: str, span: Span, called: str, is_port: bool) -> bool:
    """Whether a test has a device of the host: a rig's, but for its port; with a problem where it has not."""
    if c.project.paths.is_of_machine(path):
        c.refuse(span, f"{called} gives access to the host's disks or memory", "remove it")
    elif is_port:
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
        if not (paths.is_hardware(path) or paths.is_of_machine(path)):
            c.refuse(about.span, f"device '{word}' of '{c.name}' is no device of the host", "name a file below /dev")
        elif is_kept(c, path, about.span, f"device '{word}'", holds_port(paths.whole(path), c.project.ports)):
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
