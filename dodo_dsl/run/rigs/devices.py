"""Which device a name means, whatever the name: by its serial number, or else by the path that it resolves to."""

import hashlib
import os
import re
import stat
from pathlib import Path

from dodo_dsl.spec.deployment.rig import EMULATED

_SOCKET = re.compile(r"socket://[^/]*:(?P<port>[0-9]{1,5})")
_SYS = Path("/sys/dev/char")
_SOFTWARE = {1, 5, *range(136, 144)}
"""The kernel's numbers of memory devices, consoles and pseudo terminals (Documentation/admin-guide/devices.txt)."""
_ABOVE = 6
"""Folders of the kernel's device tree above a port in which a USB device has its serial number."""


def identity(device: str, sys: Path = _SYS) -> str:
    """What stays the same of a port or camera under all its names; empty for the emulated rig, and for a file."""
    if device in ("", EMULATED) or "\0" in device:
        return ""
    if socket := _SOCKET.fullmatch(device):
        return f"socket {socket['port']}"
    if not device.startswith("/"):
        return device
    path = os.path.realpath(device)
    try:
        status = Path(path).stat()
    except OSError:
        return f"path {path}"
    if not stat.S_ISCHR(status.st_mode):
        return ""
    return _serial_number(sys / f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}") or f"path {path}"


def is_hardware(device: str) -> bool:
    """Whether a name means a device of hardware that is there: no pseudo terminal, socket, file or device of memory."""
    try:
        status = Path(device).stat()
    except (OSError, ValueError):
        return False
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) not in _SOFTWARE


def key(device: str) -> str:
    """The identity as the name of a file: lower-case letters, digits and hyphens; empty without an identity."""
    known = identity(device)
    words = re.sub(r"[^a-z0-9]+", "-", known.lower()).strip("-")[:60]
    return (
        f"device-{words}-{hashlib.sha256(known.encode('utf-8', 'surrogateescape')).hexdigest()[:12]}" if known else ""
    )


def _serial_number(entry: Path) -> str:
    """Maker, product and serial number of the USB device that a device belongs to; empty where it has none."""
    folder = Path(os.path.realpath(entry / "device"))
    for place in (folder, *folder.parents[:_ABOVE]):
        try:
            words = [(place / name).read_text().strip() for name in ("idVendor", "idProduct", "serial")]
        except (OSError, UnicodeDecodeError):
            continue
        return f"usb {' '.join(words)}"
    return ""
