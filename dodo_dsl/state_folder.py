"""Where DoDo keeps a user's state between runs: how long tests took, and which rigs are in quarantine.

The folder is ``dodo`` in the state folder of the XDG Base Directory Specification: ``$XDG_STATE_HOME``, by default
``~/.local/state``.
"""

import os
import pwd
from pathlib import Path


class NoStateFolder(Exception):
    """This user has no home folder that could hold the state; the text says what to set."""


def state_path(variable: str, name: str) -> Path:
    """The path in an environment variable, else ``name`` in the state folder; raises NoStateFolder."""
    if named := os.environ.get(variable):
        return Path(named)
    try:
        return _state_home() / "dodo" / name
    except KeyError:
        raise NoStateFolder(f"user {os.getuid()} has no home folder: set {variable} or XDG_STATE_HOME") from None


def _state_home() -> Path:
    """Raises KeyError for a user without a home folder."""
    if not (wanted := os.environ.get("XDG_STATE_HOME")):
        return _home() / ".local" / "state"
    return _home() / wanted.removeprefix("~/") if wanted.startswith("~/") else Path(wanted)


def _home() -> Path:
    return Path(os.environ.get("HOME") or pwd.getpwuid(os.getuid()).pw_dir)
