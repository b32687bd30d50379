"""Paths of the host in a compose file: files of the repository, what else an application may mount, and rigs' ports.

Only paths that are allowed here are carried into a test, so that there is no list of what is dangerous.
"""

import contextlib
import functools
import os
import pwd
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ASK = "keep it in the repository, or allow it with 'paths' in dodo.yml"
NUL = "a path has a NUL character, so it cannot be a file"
_WITHOUT = "leave the service out: application: {without: [...]} in dodo.yml"
INSIDE = "put the files themselves in its place"

TO_READ = ("/usr/share", "/usr/src", "/lib/modules", "/lib/firmware", "/etc/localtime", "/etc/timezone",
           "/run/udev/data", "/sys/block", "/sys/bus", "/sys/class", "/sys/dev", "/sys/devices",
           "/sys/module")  # fmt: skip
"""What all users of a machine may read, and nobody keeps own files in.

Not all of ``/sys``: the engine makes only the top of a mount read-only, and a container's root could write to the
control groups of the host that are mounted below it.
"""
TMP, MEMORY = "/tmp", "/dev/shm"
_PLAIN_DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
_OF_MACHINE = re.compile(
    r"/dev/(mem|kmem|port|kmsg|(s|h|v|xv)d[a-z]\d*|(nvme|mmcblk|loop|nbd|mtd|zram|ram|vhost|tpm|watchdog)[^/]*"
    r"|(dm-|md|sr|sg|bsg/)[^/]*|(mapper|disk|block|char|cpu)(/.*)?|kvm|fuse|btrfs-control|snapshot|userfaultfd)"
)
"""Devices that are not robot hardware: disks, memory and the kernel's own."""
_OF_DESKTOP = re.compile(
    r"/(var/)?run/user/\d+/(pulse|pipewire|wayland)[^/]*(/native)?|/tmp/\.X11-unix(/.*)?|(.*/)?\.Xauthority"
)
_OF_KERNEL = ("/proc", "/sys/firmware", "/sys/fs", "/sys/hypervisor", "/sys/kernel")
_WHOLE = ("/", "/run", "/var/run", "/var", "/var/lib/docker", "/sys")
_SOCKET = re.compile(r"(docker|podman|containerd|crio)\.sock$")


def repository(folder: Path) -> tuple[Path, ...]:
    """The roots of what belongs to an application: the nearest folders with ``.git`` and ``dodo.yml``, or its own.

    A user's home, which may be kept in git as well, is none.
    """
    above = [place for place in (folder, *folder.parents) if not _is_home(place)]
    found = (next((f for f in above if (f / name).exists()), None) for name in (".git", "dodo.yml"))
    return tuple(dict.fromkeys(f for f in found if f is not None)) or (folder,)


def link_out(file: Path) -> str:
    """Where a file leads to, if its symbolic links leave a repository in which it is named; else empty."""
    whole, out = Path(os.path.abspath(file)), Path(real(file))  # noqa: PTH100  (links stay)
    named = (place for place in whole.parents if not _is_home(place))
    roots = (place for place in named if any((place / name).exists() for name in (".git", "dodo.yml")))
    return "" if all(out.is_relative_to(real(root)) for root in roots) else str(out)


def _is_home(folder: Path) -> bool:
    homes = ["/", os.environ.get("HOME") or "/"]
    with contextlib.suppress(KeyError):  # a user without an entry
        homes.append(pwd.getpwuid(os.getuid()).pw_dir)
    return str(folder) in {name for home in homes for name in (home, real(home))}


@dataclass(frozen=True)
class HostPaths:
    """Judges paths that are relative to ``folder``; ``roots`` are the repository's, ``allowed`` what dodo.yml names."""

    folder: Path
    roots: tuple[Path, ...]
    allowed: tuple[Path, ...] = ()
    _names: dict[str, tuple[str, ...]] = field(default_factory=dict, init=False, compare=False, repr=False)

    def whole(self, text: str) -> str:
        """A path as the engine would see it, without ``..``; symbolic links stay."""
        return os.path.normpath(self.folder / Path(_expanded(text)))

    def names(self, text: str) -> tuple[str, ...]:
        """The path as it is written, and where its symbolic links lead: with ``..`` resolved before and after them."""
        if text not in self._names:
            written, whole = self.folder / _expanded(text), self.whole(text)
            self._names[text] = tuple(dict.fromkeys((whole, real(whole), real(written))))
        return self._names[text]

    def is_own(self, text: str) -> bool:
        """Whether a path, and what its symbolic links lead to, lie in the repository or below an allowed path."""
        return "\0" not in text and _below(self.whole(text), self._places) and not self.link(text)

    def is_of_repository(self, text: str) -> bool:
        """Whether a path that is the application's own is a file of the repository, and so nobody's to write to."""
        count = len(self.roots)
        roots = (*self._places[:count], *self._real_places[:count])
        return any(_below(name, roots) for name in self.names(text))

    def is_writable(self, text: str) -> bool:
        """Whether an application may write to the path itself, which ``dodo.yml`` names."""
        return self.whole(text) in _PLAIN_DEVICES or (self.is_own(text) and not self.is_of_repository(text))

    def link(self, text: str) -> str:
        """Where symbolic links lead to that leave the repository and the allowed paths; empty without such a link."""
        if not _below(self.whole(text), self._places):
            return ""
        return next((name for name in self.names(text)[1:] if not _below(name, self._real_places)), "")

    def file_problem(self, text: str, written: str = "") -> str:
        """Why a file or folder may not be read, which is called as it was ``written``; empty when it may."""
        if "\0" in text:
            return NUL
        return "" if self.is_own(text) else f"'{written or text}' {self._where(text)}"

    def mount_problem(self, text: str) -> tuple[str, str] | None:
        """Why a path may not be mounted, if only to be read, and what to do."""
        if any(name in _WHOLE or _below(name, _OF_KERNEL) or _SOCKET.search(name) for name in self.names(text)):
            return f"'{text}' belongs to the host, so tests would share it", _WITHOUT
        if self.is_own(text) or self.whole(text) in _PLAIN_DEVICES or self._is_to_read(text):
            return None
        return f"'{text}' {self._where(text)}, so tests would share it", ASK

    @functools.cached_property
    def _places(self) -> tuple[str, ...]:
        return tuple(map(str, (*self.roots, *self.allowed)))

    @functools.cached_property
    def _real_places(self) -> tuple[str, ...]:
        return tuple(map(real, self._places))

    def _is_to_read(self, text: str) -> bool:
        places = (*TO_READ, *map(real, TO_READ))
        return all(_below(name, places) for name in self.names(text))

    def _where(self, text: str) -> str:
        if link := self.link(text):
            return f"is a symbolic link to '{link}', outside the repository"
        return "is outside the repository"

    def is_hardware(self, text: str, *, read_only: bool = False) -> bool:
        """Whether an absolute path is a robot's device, its settings in the kernel, or a user's sound and screen."""
        return text.startswith(("/", "~")) and all(_is_hardware(name, read_only) for name in self.names(text))


def is_token(source: str, target: str) -> bool:
    """A mount of a file of ``/tmp`` at its own place, by which programs find shared memory; the test's own has it."""
    return source.startswith(f"{TMP}/") and source == target and not _OF_DESKTOP.fullmatch(source)


def _is_hardware(name: str, read_only: bool) -> bool:
    if _below(name, [MEMORY]) or name in _PLAIN_DEVICES or name == "/sys" or _below(name, _OF_KERNEL):
        return False
    is_device = (_below(name, ["/dev"]) and not _OF_MACHINE.fullmatch(name)) or bool(_OF_DESKTOP.fullmatch(name))
    return is_device or (_below(name, ["/sys"]) and not read_only)


def _below(path: str, places: Sequence[str]) -> bool:
    return any(path == place or path.startswith(f"{place.rstrip('/')}/") for place in places)


def _expanded(text: str) -> str:
    """With the home in the place of ``~``: for a user without one a path that is nobody's."""
    if not text.startswith("~"):
        return text
    path = os.path.expanduser(text)  # noqa: PTH111  (it never raises)
    return f"/{text}" if path == text else path


def real(path: str | Path) -> str:
    """Where symbolic links lead to; the path itself where that may not be known, as in ``/proc``."""
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):  # of a path with a NUL
        return str(path)


_WAYS = ("/dev/serial", "/dev/bus/usb")
"""Folders where a port has its other names, and where its USB device can be spoken to directly."""


def is_port(path: str, ports: Iterable[str], *, within: bool = False) -> bool:
    """Whether a path is a rig's port, one of its names, or a way to it; a rig is moved by its own service alone.

    Or whether a port lies ``within`` a folder, as an engine gives a container all devices in it.
    """
    files = [name for port in ports if port.startswith("/") for name in (os.path.normpath(port), real(port))]
    names = (os.path.normpath(path), real(path))
    is_way = any(name in files or _below(name, _WAYS) for name in names)
    return bool(files) and (is_way or (within and any(_below(file, names) for file in files)))
