"""What a container may have of a machine: devices and privileges where a rig allows them, graphics processors."""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application.compose_paths import escaped
from dodo_dsl.application.host_paths import holds_port, is_rule_for_port
from dodo_dsl.application.model import is_true, plain
from dodo_dsl.application.part import NO_PORT, WITHOUT_HARDWARE
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node

if TYPE_CHECKING:
    from dodo_dsl.application.container import Container

_CAPABILITIES = frozenset(
    ("AUDIT_WRITE", "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "IPC_LOCK", "KILL", "NET_BIND_SERVICE", "SETFCAP",
     "SETGID", "SETPCAP", "SETUID", "SYS_CHROOT", "SYS_NICE", "SYS_PTRACE")
)  # fmt: skip
"""Capabilities that stay within a container; with others it reaches the host, or speaks for other containers."""
_RUNTIMES = ("nvidia", "runc", "runsc")
_OTHER = "give the application another device"
_CDI = "is a description of the host, which can mount anything"
_CHARACTERS = re.compile(r"c [0-9*]+:[0-9*]+ [rwm]+")


def devices(c: "Container", node: Node) -> Any:
    made = []
    for item, word in _words(c, node):
        about = item.entries["source"].value if isinstance(item, source.Mapping) else item
        path, paths = word.partition(":")[0], c.project.paths
        if link := paths.link(path):
            message = f"device '{word}' is a symbolic link to '{link}', outside the repository"
            c.refuse(about.span, message, "name the device itself")
        elif "=" in path and not path.startswith("/"):
            c.refuse(about.span, f"device '{word}' {_CDI}", "name a file below /dev")
        elif paths.is_of_machine(path):
            c.refuse(about.span, f"device '{word}' gives access to the host's disks or memory", "remove it")
        elif holds_port(paths.whole(path), c.project.ports):
            c.hardware(about.span, f"device '{word}' of '{c.name}' {NO_PORT}", _OTHER)
        elif c.project.setting.hil:
            made.append(plain(item))
        else:
            c.hardware(about.span, f"device '{word}' of '{c.name}' {WITHOUT_HARDWARE}")
    return made or None


def device_rules(c: "Container", node: Node) -> Any:
    made = []
    for item, word in _words(c, node):
        if is_rule_for_port(word, c.project.ports):
            c.hardware(item.span, f"rule '{word}' of '{c.name}' {NO_PORT}", _OTHER)
        elif not _CHARACTERS.fullmatch(word):
            message = f"the rule '{word}' gives access to the host's disks"
            c.refuse(item.span, message, "name character devices, for example c 81:* rw")
        elif c.project.setting.hil:
            made.append(word)
        else:
            c.hardware(item.span, f"device '{word}' of '{c.name}' {WITHOUT_HARDWARE}")
    return made or None


def privileged(c: "Container", node: Node) -> Any:
    word = c.literal(node)
    if not word or not is_true(word):
        return None
    if c.project.setting.keeps_privileges:
        return True
    c.hardware(node.span, f"'privileged' of '{c.name}' {WITHOUT_HARDWARE}")
    return None


def capabilities(c: "Container", node: Node) -> Any:
    made = []
    for item, word in _words(c, node):
        if word.upper().removeprefix("CAP_") in _CAPABILITIES or c.project.setting.keeps_privileges:
            made.append(word)
        else:
            c.hardware(item.span, f"capability '{word}' of '{c.name}' {WITHOUT_HARDWARE}")
    return made or None


def security(c: "Container", node: Node) -> Any:
    """Options that leave no more access than there is without them; a rig may allow others."""
    made = []
    for item, word in _words(c, node):
        if re.split("[:=]", word)[0] == "no-new-privileges" or c.project.setting.keeps_privileges:
            made.append(escaped(word))
        else:
            message = f"'{word}' of '{c.name}' is left out, the engine's own confinement stays"
            c.add(Diagnostic(item.span, "application-isolation", message, severity="warning"))
    return made or None


def _words(c: "Container", node: Node) -> Iterator[tuple[Node, str]]:
    """The texts of a list that are known, each with its place."""
    for item in c.items(node):
        about = item.get("source") if isinstance(item, source.Mapping) else item
        if about is not None and (word := c.literal(about)):
            yield item, word


def runtime(c: "Container", node: Node) -> Any:
    word = c.literal(node)
    if word in (*_RUNTIMES, "", None):
        return word or None
    message = f"the runtime '{word}' may not isolate the container"
    c.refuse(node.span, message, f"remove it, or use one of {', '.join(_RUNTIMES)}")
    return None


def gpus(c: "Container", node: Node) -> Any:
    """Requests of graphics processors; other devices by their description (CDI) are refused."""
    made = []
    for item in c.items(node):
        if not isinstance(item, source.Mapping):
            return plain(item)
        fields = c.fields(item, f"'gpus' of '{c.name}'", "driver count device_ids capabilities options")
        drivers, ids = ([*c.items(fields[key])] if key in fields else [] for key in ("driver", "device_ids"))
        wrong = [word for word in drivers if (c.literal(word) or "").lower() not in ("", "nvidia", "amd")]
        wrong += [word for word in ids if "=" in (c.literal(word) or "")]
        if wrong:
            message = f"'{plain(wrong[0])}' of a device of '{c.name}' {_CDI}"
            c.refuse(wrong[0].span, message, "use numbers or UUIDs of GPUs, and nvidia or no driver")
        else:
            made.append({key: plain(value) for key, value in fields.items()})
    return made or None
