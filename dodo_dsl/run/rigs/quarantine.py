"""The quarantine of rigs that failed their health check: it lasts until somebody clears it.

It belongs to the rig's devices, so that another name in a ``dodo.yml`` does not end it, and to its name, as a device
may be unplugged.
"""

import contextlib
import json
import re
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.run.rigs import devices as hardware
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.machine import MachineError, machine
from dodo_dsl.state_folder import NoStateFolder, secured, state_path

FOLDER_VARIABLE = "DODO_RIGS"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def folder() -> Path:
    """The operator's folder, else ``DODO_RIGS``, else one in this user's state folder; raises RigProblem."""
    try:
        operators = machine()
        if operators is not None and operators.quarantine is not None:
            return operators.quarantine
        return state_path(FOLDER_VARIABLE, "rigs")
    except NoStateFolder as error:
        raise RigProblem(f"quarantines cannot be kept: {error}") from error
    except MachineError as error:
        raise RigProblem(f"quarantines cannot be kept: {error.filename}: {error.strerror}") from error


def _files(rig: str, devices: Iterable[str]) -> list[Path]:
    """The file of the rig's name, and of each device."""
    if not _NAME.fullmatch(rig):
        raise RigProblem(f"'{rig}' is not a rig's name, expected lower-case letters, digits and hyphens")
    keys = sorted({hardware.key(device) for device in devices} - {""})
    return [folder() / f"{key}.json" for key in (rig, *keys)]


def quarantined(rig: str, devices: Sequence[str] = ()) -> str:
    """Why a rig or one of its devices is in quarantine; empty when none is. Raises RigProblem."""
    reasons = (reason for file in _files(rig, devices) if (reason := _read(file)[1]))
    return next(reasons, "")


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason; raises RigProblem."""
    return dict(_read(path) for path in sorted(folder().glob("*.json")) if _NAME.fullmatch(path.stem))


def quarantine(rig: str, reason: str, devices: Sequence[str] = ()) -> None:
    """Puts a rig into quarantine: tests on it end in error from now on. Raises RigProblem."""
    record = json.dumps({"rig": rig, "reason": reason, "when": int(time.time())})
    for path in _files(rig, devices):
        try:
            secured(path.parent)
            atomic.write_text(path, record + "\n", durable=True)
        except OSError as error:
            raise RigProblem(f"its quarantine cannot be written to '{path}': {error.strerror} ({reason})") from error


def clear(rig: str, devices: Sequence[str] = ()) -> bool:
    """Ends a quarantine, under the name that the rig had then, too; whether there was one. Raises RigProblem."""
    found = [path for path in _files(rig, devices) if path.exists()]
    names = {name for name, _ in map(_read, found) if _NAME.fullmatch(name)}
    for path in (*found, *(folder() / f"{name}.json" for name in names)):
        path.unlink(missing_ok=True)
    return bool(found)


def _read(path: Path) -> tuple[str, str]:
    """The name of the rig and the reason; without a reason where there is no file. Raises RigProblem."""
    try:
        if path.parent.is_dir():
            secured(path.parent)
        record = regular_file.text(path)
    except FileNotFoundError:
        return path.stem, ""
    except OSError as error:
        raise RigProblem(f"'{error.filename or path}' cannot be read: {error.strerror}") from error
    except UnicodeDecodeError:
        record = ""
    with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
        found = json.loads(record)
        return str(found.get("rig", path.stem)), str(found["reason"])
    return path.stem, "its quarantine file cannot be read"
