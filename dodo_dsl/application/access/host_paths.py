"""Paths of the host in a compose file: files of the repository, and folders that an application may mount."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ASK = "keep it in the repository, or allow it with 'paths' in dodo.yml"
_INSIDE = "keep it in the repository, or write the whole path"

_FOLDERS = ("/opt", "/srv", "/mnt", "/media", "/data", "/tmp")
_TO_READ = ("/usr/share", "/usr/local", "/usr/src", "/lib/modules", "/lib/firmware", "/etc/localtime", "/etc/timezone",
            "/run/udev", "/sys")  # fmt: skip
_TMP = "/tmp"
"""What is named there may be mounted, even where the repository lies in it: nobody keeps repositories there."""
_DEVICES = ("/dev", "/sys")
_HOMES = re.compile(r"/(?:home/[^/]+|root|Users/[^/]+)(?:/|$)")
_OF_X11 = ".Xauthority"


def repository(folder: Path) -> tuple[Path, ...]:
    """The roots of what belongs to an application: the nearest folders with ``.git`` and ``dodo.yml``, or its own."""
    above = (folder, *folder.parents)
    found = (next((f for f in above if (f / name).exists()), None) for name in (".git", "dodo.yml"))
    return tuple(dict.fromkeys(f for f in found if f is not None)) or (folder,)


@dataclass(frozen=True)
class HostPaths:
    """Judges paths that are relative to ``folder``; ``roots`` and ``allowed`` hold what may be used as it is.

    A path with a variable is judged when that is filled in: then paths are ``literal``, and a dollar sign is one.
    """

    folder: Path
    roots: tuple[Path, ...]
    allowed: tuple[Path, ...] = ()
    literal: bool = False

    def whole(self, text: str) -> str:
        """A path as the engine would see it, without ``..``; symbolic links stay."""
        return os.path.normpath(self.folder / Path(_expanded(text)))

    def is_own(self, text: str) -> bool:
        """Whether a path, and what its symbolic links lead to, lie in the repository or below an allowed path."""
        places = (*self.roots, *self.allowed)
        path = self.whole(text)
        return _below(path, places) and _below(_real(path), [Path(_real(p)) for p in places])

    def _is_open(self, text: str) -> bool:
        return "$" in text and not self.literal

    def file_problem(self, text: str, written: str = "") -> str:
        """Why a file or folder may not be read, which is called as it was ``written``; empty when it may."""
        if self._is_open(text) or self.is_own(text):
            return ""
        return f"'{written or text}' {self._where(text)}"

    def mount_problem(self, text: str, read_only: bool) -> tuple[str, str]:
        """Why a path may not be mounted, and what to do; empty when it may."""
        if self._is_open(text) or self.is_own(text):
            return "", ""
        path = _real(self.whole(text))
        is_tmp = text.startswith("/") and _below(path, [Path(_TMP)])
        if not is_tmp and any(_below(str(root), [Path(path)]) for root in self.roots):
            return f"'{text}' holds the whole repository and more", _INSIDE
        if not text.startswith(("/", "~")):
            return f"'{text}' {self._where(text)}", _INSIDE
        if self._is_folder_to_mount(path) or _below(path, map(Path, _DEVICES)):
            return "", ""
        if _below(path, map(Path, _TO_READ)):
            return ("", "") if read_only else (f"'{text}' belongs to the host", "mount it read-only (:ro)")
        return f"'{text}' belongs to the host, so tests would share it", ASK

    def _is_folder_to_mount(self, path: str) -> bool:
        home = _HOMES.match(path)
        if home is None:
            own = _expanded("~")
            return _below(path, map(Path, _FOLDERS)) or (_below(path, [Path(own)]) and _is_plain(path[len(own) + 1 :]))
        return _is_plain(path[home.end() :])

    def _where(self, text: str) -> str:
        path = self.whole(text)
        real = _real(path)
        if _below(path, (*self.roots, *self.allowed)):
            return f"is a symbolic link to '{real}', outside the repository"
        return "is outside the repository"


def _is_plain(rest: str) -> bool:
    """Whether a path within a home folder is one of the user's data, and no file of settings or keys."""
    return bool(rest) and (not rest.startswith(".") or rest == _OF_X11)


def _below(path: str, places: "Sequence[Path] | map[Path]") -> bool:
    return any(path == str(place) or path.startswith(f"{str(place).rstrip('/')}/") for place in places)


def _expanded(text: str) -> str:
    return os.path.expanduser(text) if text.startswith("~") else text  # noqa: PTH111  (it never raises)


def _real(path: str | Path) -> str:
    """Where symbolic links lead to; the path itself where that may not be known, as in ``/proc``."""
    try:
        return os.path.realpath(path)
    except OSError:
        return str(path)
