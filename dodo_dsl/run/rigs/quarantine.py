"""The quarantine of rigs that failed their health check: it lasts until somebody clears it.

It belongs to the rig's devices, so that another name in a ``dodo.yml`` does not end it, and to its name, as a device
may be unplugged.
"""

import contextlib
import json
import re
import time
from collections.abc import Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.run.rigs import devices as hardware
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.deployment.machine import MachineError, machine
from dodo_dsl.state_folder import NoStateFolder, account_path, secured, state_path

FOLDER_VARIABLE = "DODO_RIGS"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def folder(is_hardware: bool = False) -> Path:
    """The operator's folder, else ``DODO_RIGS``, else one in this user's state folder; raises RigProblem.

    Variables do not count for hardware, as a job could set them.
    """
    try:
        operators = machine()
        if operators is not None and operators.quarantine is not None:
            return operators.quarantine
        return account_path("rigs") if is_hardware else state_path(FOLDER_VARIABLE, "rigs")
    except (NoStateFolder, MachineError) as error:
        raise RigProblem(f"quarantines cannot be kept: {error}") from error


def _files(rig: str, devices: Sequence[str]) -> list[Path]:
    """The file of the rig's name, and of each device."""
    if not _NAME.fullmatch(rig):
        raise RigProblem(f"'{rig}' is not a rig's name, expected lower-case letters, digits and hyphens")
    keys = sorted({hardware.key(device) for device in devices} - {""})
    place = folder(any(map(hardware.is_hardware, devices)))
    return [place / f"{key}.json" for key in (rig, *keys)]


def quarantined(rig: str, devices: Sequence[str] = ()) -> str:
    """Why a rig or one of its devices is in quarantine; empty when none is. Raises RigProblem."""
    reasons = (reason for file in _files(rig, devices) if (reason := _read(file)[1]))
    return next(reasons, "")


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason; raises RigProblem."""
    places = {folder()}
    with contextlib.suppress(RigProblem):
        places.add(folder(is_hardware=True))
    paths = (path for place in sorted(places) for path in sorted(place.glob("*.json")))
    return dict(_read(path) for path in paths if _NAME.fullmatch(path.stem))


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
    also = [path.with_stem(name) for path in found if _NAME.fullmatch(name := _read(path)[0])]
    for path in (*found, *also):
        path.unlink(missing_ok=True)
    return bool(found)


def _read(path: Path) -> tuple[str, str]:
    """The name of the rig and the reason, which is empty without a file. Raises RigProblem."""
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
