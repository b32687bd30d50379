"""The quarantine of rigs that failed their health check: it lasts until somebody clears it."""

import contextlib
import json
import re
import time
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.state_folder import NoStateFolder, state_path

FOLDER_VARIABLE = "DODO_RIGS"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def folder() -> Path:
    """``DODO_RIGS``, else a folder in this user's state folder; raises RigProblem for a user without a home folder."""
    try:
        return state_path(FOLDER_VARIABLE, "rigs")
    except NoStateFolder as error:
        raise RigProblem(f"quarantines cannot be kept: {error}") from error


def _file(rig: str) -> Path:
    if not _NAME.fullmatch(rig):
        raise RigProblem(f"'{rig}' is not a rig's name, expected lower-case letters, digits and hyphens")
    return folder() / f"{rig}.json"


def quarantined(rig: str) -> str:
    """Why a rig is in quarantine; empty when it is not. Raises RigProblem."""
    try:
        text = _file(rig).read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise RigProblem(f"'{_file(rig)}' cannot be read: {error.strerror}") from error
    with contextlib.suppress(ValueError, KeyError, TypeError):
        return str(json.loads(text)["reason"])
    return "its quarantine file cannot be read"


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason; raises RigProblem."""
    return {path.stem: quarantined(path.stem) for path in sorted(folder().glob("*.json")) if _NAME.fullmatch(path.stem)}


def quarantine(rig: str, reason: str) -> None:
    """Puts a rig into quarantine: tests on it end in error from now on. Raises RigProblem."""
    path = _file(rig)
    record = json.dumps({"rig": rig, "reason": reason, "when": int(time.time())})
    try:
        atomic.write_text(path, record + "\n", durable=True)
    except OSError as error:
        raise RigProblem(f"its quarantine cannot be written to '{path}': {error.strerror} ({reason})") from error


def clear(rig: str) -> bool:
    """Ends a quarantine; whether there was one. Raises RigProblem."""
    path = _file(rig)
    is_held = path.exists()
    path.unlink(missing_ok=True)
    return is_held
