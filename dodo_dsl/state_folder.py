"""Where DoDo keeps a user's state between runs: how long tests took, and which rigs are in quarantine.

The folder is ``dodo`` in the state folder of the XDG Base Directory Specification: ``$XDG_STATE_HOME``, by default
``~/.local/state``.
"""

import contextlib
import errno
import os
import pwd
import shlex
import stat
from pathlib import Path

SHARED = Path("/var/lib/dodo")


class NoStateFolder(Exception):
    """This user has no home folder that could hold the state; the text shows what to set."""


def state_path(variable: str, name: str) -> Path:
    """The path in an environment variable, else ``name`` in the state folder; raises NoStateFolder."""
    if named := os.environ.get(variable):
        return Path(named)
    try:
        return _state_home() / "dodo" / name
    except KeyError:
        raise NoStateFolder(f"user {os.getuid()} has no home folder: set {variable} or XDG_STATE_HOME") from None


def account_path(name: str) -> Path:
    """``name`` in the state folder of this user's account, whatever variables say; raises NoStateFolder."""
    try:
        return Path(pwd.getpwuid(os.getuid()).pw_dir) / ".local" / "state" / "dodo" / name
    except KeyError:
        raise NoStateFolder(f"user {os.getuid()} has no account with a home folder") from None


def shared_path(name: str) -> Path | None:
    """``name`` in the folder that root made for all users of this computer, whatever variables say; None without."""
    return path if (path := SHARED / name).is_dir() else None


class UnsafeFolder(OSError):
    """Others could write into a folder of DoDo's state; the text shows what to do."""


def secured(folder: Path) -> Path:
    """The folder, which only its owner can write: this user or root; it is made, with mode 0700, if there is none.

    Of a folder of root the group may write, too, as several users share the state then. Raises UnsafeFolder, also for
    a symlink, and OSError.
    """
    with contextlib.suppress(FileExistsError):  # the next call reports a file in its place
        folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        _check(folder)
    return folder


def _check(folder: Path) -> None:
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        raise UnsafeFolder(errno.ENOTDIR, "not a folder, and DoDo keeps no state where it points to", str(folder))
    if status.st_uid not in (os.geteuid(), 0):
        raise UnsafeFolder(errno.EPERM, f"belongs to user {status.st_uid}, who could change DoDo's state", str(folder))
    if status.st_mode & stat.S_IWOTH:
        command = f"{'' if status.st_uid == os.geteuid() else 'sudo '}chmod 700 {shlex.quote(str(folder))}"
        raise UnsafeFolder(errno.EPERM, f"all users can write it, and so DoDo's state: {command}", str(folder))
    if status.st_mode & stat.S_IWGRP and status.st_uid != 0:
        folder.chmod(stat.S_IMODE(status.st_mode) & ~stat.S_IWGRP)


def _state_home() -> Path:
    """Raises KeyError for a user without a home folder."""
    if not (wanted := os.environ.get("XDG_STATE_HOME")):
        return _home() / ".local" / "state"
    return _home() / wanted.removeprefix("~/") if wanted.startswith("~/") else Path(wanted)


def _home() -> Path:
    return Path(os.environ.get("HOME") or pwd.getpwuid(os.getuid()).pw_dir)


def cache_home() -> Path:
    """The folder of a user's caches (XDG Base Directory Specification); a relative path in the variable counts as none.

    Raises KeyError for a user without a home folder.
    """
    wanted = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return wanted if wanted.is_absolute() else _home() / ".cache"
