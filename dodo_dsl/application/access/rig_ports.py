"""Ports of rigs in a compose file: the rig is moved by its own service, and no application gets its port."""

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl.application import host_access
from dodo_dsl.application.access.host_paths import real

WHY = "is left out of all tests: only the service that moves the rig opens its port"
HINT = "give the application another device"
_WAYS = ("/dev/serial", "/dev/bus/usb")
"""Folders where a port has its other names, and where its USB device can be spoken to directly."""
_TERMINALS = frozenset((*range(4, 6), 166, 188, 189, 204, 205))
"""The kernel's numbers of serial ports and of USB devices (Documentation/admin-guide/devices.txt)."""
_RULE = re.compile(r"[ac] ([0-9]+|\*):([0-9]+|\*) [rwm]+")


def is_port(device: str, ports: Iterable[str]) -> bool:
    """Whether a device file is a rig's port, one of its names, or a way to it."""
    files = list(_files(ports))
    names = _names(device)
    return bool(files) and any(name in files or _is_below(name, _WAYS) for name in names)


def holds_port(folder: str, ports: Iterable[str]) -> bool:
    """The same, and of a folder whether it holds a port: an engine gives a container all devices in it."""
    files = list(_files(ports))
    return is_port(folder, files) or any(_is_below(file, _names(folder)) for file in files)


def is_rule_for_port(rule: object, ports: Iterable[str]) -> bool:
    """Whether a rule of ``device_cgroup_rules`` lets a container open a port."""
    found = _RULE.fullmatch(str(rule))
    files = list(_files(ports))
    if found is None or not files:
        return False
    major, minor = found.groups()
    return major == "*" or int(major) in _TERMINALS or (int(major), minor) in set(_numbers(files))


def source(device: object) -> str:
    """The host's path in an entry of ``devices``, of its short or its long form."""
    written = device.get("source") if isinstance(device, dict) else device
    return host_access.mount(f"{written or ''}:").source


def _files(ports: Iterable[str]) -> Iterator[str]:
    """All names of those ports that are device files."""
    for port in ports:
        if port.startswith("/"):
            yield from _names(port)


def _names(path: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((os.path.normpath(path), real(path))))


def _is_below(path: str, folders: Iterable[str]) -> bool:
    return any(path == folder or path.startswith(f"{folder.rstrip('/')}/") for folder in folders)


def _numbers(files: Iterable[str]) -> Iterator[tuple[int, str]]:
    """The kernel's numbers of ports that are there: of each one its own, and all beside it."""
    for file in files:
        try:
            number = Path(file).stat().st_rdev
        except OSError:
            continue
        yield from ((os.major(number), minor) for minor in (str(os.minor(number)), "*"))
