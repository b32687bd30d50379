"""Access of a service to its host: to hardware, and to what tests cannot have separately."""

import posixpath
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from dodo_dsl.application.compose_paths import is_path
from dodo_dsl.application.interpolation import split_outside

CONTAINER_CAPABILITIES = frozenset(
    (
        *("AUDIT_WRITE", "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "IPC_LOCK", "KILL", "NET_BIND_SERVICE"),
        *("SETFCAP", "SETGID", "SETPCAP", "SETUID", "SYS_CHROOT", "SYS_NICE", "SYS_PTRACE"),
    )
)
"""Capabilities that stay within a container; with others it reaches the host, or speaks for other containers."""
HARDWARE_KEYS = ("devices", "device_cgroup_rules")
NAMESPACES = ("network_mode", "ipc", "pid")

PLAIN_DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
_OF_MACHINE = re.compile(
    r"/dev/(mem|kmem|port|kmsg|(s|h|v|xv)d[a-z]\d*|(nvme|mmcblk|loop|nbd|mtd|zram|ram|vhost|tpm|watchdog)[^/]*"
    r"|(dm-|md|sr|sg|bsg/)[^/]*|(mapper|disk|block|char|cpu)(/.*)?|kvm|fuse|btrfs-control|snapshot|userfaultfd)"
)
"""Devices that are not robot hardware: disks, memory and the kernel's own."""
_OF_DESKTOP = re.compile(
    r"/(var/)?run/user/\d+/(pulse|pipewire|wayland)[^/]*(/native)?|/tmp/\.X11-unix(/.*)?|(.*/)?\.Xauthority"
)
_FALSE = ("false", "f", "0", "no", "n", "off", "")
_WHOLE = ("/", "/run", "/var/run", "/var", "/var/lib/docker")
_OF_KERNEL = ("/proc", "/sys/firmware", "/sys/fs", "/sys/hypervisor", "/sys/kernel")
_SOCKET = re.compile(r"(docker|podman|containerd|crio)\.sock$")


@dataclass(frozen=True)
class Mount:
    """An entry of ``volumes``: a path or a volume's name in ``source``, empty for an unnamed volume."""

    source: str
    target: str
    read_only: bool = False

    def below(self, folder: str) -> bool:
        return self.source == folder or self.source.startswith(f"{folder}/")


def mount(volume: Any) -> Mount:
    """A mount from its short or its long form."""
    if isinstance(volume, dict):
        origin, target = str(volume.get("source") or ""), str(volume.get("target") or "")
        return Mount(_clean(origin), _clean(target), is_true(volume.get("read_only") or False))
    parts = split_outside(str(volume), ":")
    if len(parts) == 1:
        return Mount("", _clean(parts[0]))
    access = [word for word in mount_options(volume) if word in ("ro", "rw")]
    return Mount(_clean(parts[0]), _clean(parts[1]), access[-1:] == ["ro"])


def mount_options(volume: Any) -> list[str]:
    """The words after a short form's second colon; of ``ro`` and ``rw``, the last one counts."""
    parts = split_outside(volume, ":") if isinstance(volume, str) else []
    return [word for part in parts[2:] for word in part.split(",")]


def is_bind(volume: Any, source: str) -> bool:
    """Whether a mount shows a path of the host, and no volume."""
    if isinstance(volume, dict):
        return volume.get("type") not in ("tmpfs", "image") and (volume.get("type") == "bind" or is_path(source))
    return is_path(source)


def named_volume(volume: Any) -> str:
    """The name of the volume that an entry of ``volumes`` mounts; empty for a path, a variable, or without a name."""
    source = mount(volume).source
    if is_path(source) or "$" in source:
        return ""
    if isinstance(volume, dict):
        return source if volume.get("type") == "volume" else ""
    return "" if len(source) == 1 or source.startswith("\\\\") else source  # a path of Windows


def _clean(path: str) -> str:
    return posixpath.normpath(path) if path.startswith("/") else path


def is_shared_memory(found: Mount) -> bool:
    return found.below("/dev/shm")


def is_token(found: Mount) -> bool:
    """A mount of a file of ``/tmp`` at its own place, by which programs find shared memory; the test's own has it."""
    return found.below("/tmp") and found.source == found.target and not _OF_DESKTOP.fullmatch(found.source)


def is_hardware(found: Mount) -> bool:
    """A mount of devices, of their settings in the kernel, or of a user's sound and screen."""
    if is_shared_memory(found) or found.source in PLAIN_DEVICES:
        return False
    is_device = found.below("/dev") or bool(_OF_DESKTOP.fullmatch(found.source))
    return is_device or (found.below("/sys") and not found.read_only)


def is_machine(found: Mount) -> bool:
    """A mount that gives access to the host itself, or to other tests' containers."""
    is_of_kernel = found.source == "/sys" or any(map(found.below, _OF_KERNEL))
    return is_of_kernel or found.source in _WHOLE or bool(_SOCKET.search(found.source))


def is_of_machine(device: object) -> bool:
    """Whether a device file is one of the host's disks, its memory or its kernel; of a short form, its source."""
    parts = split_outside(str(device or ""), ":")
    return bool(_OF_MACHINE.fullmatch(_clean(parts[0])))


def is_harmless_capability(word: object) -> bool:
    """Whether a capability stays within the container."""
    return str(word).upper().removeprefix("CAP_") in CONTAINER_CAPABILITIES


def is_confining(option: object) -> bool:
    """Whether a security option leaves no more access than there is without it."""
    return re.split("[:=]", str(option))[0] == "no-new-privileges"


def is_true(value: object) -> bool:
    """Whether compose reads a value as true, or may do so once its variables are filled in."""
    return value is True or (isinstance(value, str) and value.strip().lower() not in _FALSE)


def is_bound(volume: object) -> bool:
    """Whether a top-level volume is a folder of the host."""
    return bool({"bind", "rbind"} & {word.strip() for word in volume_options(volume)})


def volume_options(volume: object) -> list[str]:
    """The words of ``o`` of a top-level volume, as the engine splits them: it keeps spaces."""
    options = volume.get("driver_opts") if isinstance(volume, dict) else None
    return str(options.get("o") or "").split(",") if isinstance(options, dict) else []


def is_read_only(volume: object) -> bool:
    """Whether a top-level volume can only be read; of ``ro`` and ``rw``, the last one counts."""
    return [word for word in volume_options(volume) if word in ("ro", "rw")][-1:] == ["ro"]


def is_external(volume: object) -> bool:
    """Whether a top-level volume, secret or config is one that exists already."""
    external = volume.get("external", False) if isinstance(volume, dict) else False
    return isinstance(external, dict) or is_true(external)


def reference(value: object) -> tuple[str, str]:
    """``service:x`` and ``container:x`` as kind and name; two empty strings for other values."""
    kind, sign, name = str(value or "").partition(":")
    return (kind, name) if sign and kind in ("service", "container") else ("", "")


def borrowed(entry: object) -> tuple[str, str, str]:
    """An entry of ``volumes_from`` as kind, name and options."""
    kind, name = reference(entry)
    rest = name if kind else str(entry)
    name, sign, options = rest.partition(":")
    return kind or "service", name, sign + options


def references(service: dict[str, Any], containers: dict[str, str]) -> Iterator[tuple[str, str]]:
    """The services that a service needs, each with its key; containers of the application count as its services."""
    for key in NAMESPACES:
        kind, name = reference(service.get(key))
        if kind == "service" or name in containers:
            yield key, containers.get(name, name) if kind == "container" else name
    for entry in service.get("volumes_from") or ():
        kind, name, _ = borrowed(entry)
        if kind == "service" or name in containers:
            yield "volumes_from", containers.get(name, name) if kind == "container" else name
    for link in service.get("links") or ():
        yield "links", str(link).partition(":")[0]
    waits = service.get("depends_on") or {}
    for name in waits:
        options = waits[name] if isinstance(waits, dict) else {}
        if not isinstance(options, dict) or options.get("required") is not False:
            yield "depends_on", str(name)
