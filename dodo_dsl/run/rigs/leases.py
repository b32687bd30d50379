"""Leases and quarantine of rigs, by CID, name and devices.

A device is the same under all its names: it is known by the path that a name resolves to. A quarantine of a rig that
failed its health check lasts until somebody clears it. It belongs to the rig's devices, so that another name in a
``dodo.yml`` does not end it, and to its name, as a device may be unplugged.
"""

import contextlib
import hashlib
import json
import os
import re
import stat
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import leases
from dodo_dsl.run.rigs.problems import RigProblem
from dodo_dsl.spec.rig import EMULATED
from dodo_dsl.state_folder import NoStateFolder, account_path, secured, shared_path, state_path

DEVICE_FLAGS = ("--serial", "--source")
"""Flags of programs and services that name hardware."""
FOLDER_VARIABLE = "DODO_RIGS"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")
_SOFTWARE = {1, 5, *range(136, 144)}
"""The kernel's numbers of memory devices, consoles and pseudo terminals (Documentation/admin-guide/devices.txt)."""


def identity(device: str) -> str:
    """What stays the same of a port or camera under all its names; empty for the emulated rig, and for a file."""
    if device in ("", EMULATED) or "\0" in device:
        return ""
    if not device.startswith("/"):
        return device
    path = os.path.realpath(device)
    with contextlib.suppress(OSError):
        if not stat.S_ISCHR(Path(path).stat().st_mode):
            return ""
    return path


def is_hardware_device(device: str) -> bool:
    """Whether a name means a device of hardware that is there: no pseudo terminal, file or device of memory."""
    try:
        status = Path(device).stat()
    except (OSError, ValueError):
        return False
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) not in _SOFTWARE


def device_keys(devices: Iterable[str]) -> list[str]:
    """The identities as names of leases and files: lower-case letters, digits and hyphens."""
    return sorted({_key(known) for known in map(identity, devices) if known})


def _key(known: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", known.lower()).strip("-")[:60]
    return f"device-{words}-{hashlib.sha256(known.encode('utf-8', 'surrogateescape')).hexdigest()[:12]}"


def devices_in(words: Iterable[str]) -> list[str]:
    """The hardware that flags ``--name=value`` name."""
    return [value for flag, _, value in (word.partition("=") for word in words) if flag in DEVICE_FLAGS]


def devices_of(plan: Plan) -> list[str]:
    return devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)


@contextlib.asynccontextmanager
async def leased(
    cid: int | None,
    user: str,
    say: Callable[[str], None],
    patience_s: float = leases.DEFAULT_PATIENCE_S,
    devices: Sequence[str] = (),
) -> AsyncIterator[tuple[int, ...]]:
    """Holds the leases of a rig's CID and devices, and gives their descriptors; raises LeaseTimeout."""
    with contextlib.ExitStack() as held:
        descriptors = []
        for name in [*([] if cid is None else [f"cid-{cid}"]), *device_keys(devices)]:
            lease = await leases.lease_any([name], {"test": user}, say, patience_s=patience_s)
            held.callback(lease.release)
            descriptors.append(lease.descriptor)
        yield tuple(descriptors)


def quarantine_folder(is_hardware: bool = False) -> Path:
    """Where quarantines are: for all users, else in ``DODO_RIGS``, else in this user's state; raises RigProblem.

    Variables do not count for hardware, as a job could set them.
    """
    try:
        own = shared_path("rigs")
        return own or (account_path("rigs") if is_hardware else state_path(FOLDER_VARIABLE, "rigs"))
    except NoStateFolder as error:
        raise RigProblem(f"quarantines cannot be kept: {error}") from error


def _files(rig: str, devices: Sequence[str]) -> list[Path]:
    if not _NAME.fullmatch(rig):
        raise RigProblem(f"'{rig}' is not a rig's name, expected lower-case letters, digits and hyphens")
    place = quarantine_folder(any(map(is_hardware_device, devices)))
    return [place / f"{key}.json" for key in (rig, *device_keys(devices))]


def quarantined(rig: str, devices: Sequence[str] = ()) -> str:
    """Why a rig or one of its devices is in quarantine; empty when none is. Raises RigProblem."""
    reasons = (reason for file in _files(rig, devices) if (reason := _read(file)[1]))
    return next(reasons, "")


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason; raises RigProblem."""
    places = {quarantine_folder()}
    with contextlib.suppress(RigProblem):  # a user without an account has no hardware in quarantine
        places.add(quarantine_folder(is_hardware=True))
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


def clear_quarantine(rig: str, devices: Sequence[str] = ()) -> bool:
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
