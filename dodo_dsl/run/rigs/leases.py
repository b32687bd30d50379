"""Leases and quarantine of rigs, by CID, name and devices.

A device is the same under all its names: it is known by its serial number, or else by the path that a name resolves to.
A quarantine of a rig that failed its health check lasts until somebody clears it. It belongs to the rig's devices, so
that another name in a ``dodo.yml`` does not end it, and to its name, as a device may be unplugged.
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
from dodo_dsl.spec.machine import MachineError, machine
from dodo_dsl.spec.rig import EMULATED
from dodo_dsl.state_folder import NoStateFolder, account_path, secured, state_path

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


def is_hardware_device(device: str) -> bool:
    """Whether a name means a device of hardware that is there: no pseudo terminal, socket, file or device of memory."""
    try:
        status = Path(device).stat()
    except (OSError, ValueError):
        return False
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) not in _SOFTWARE


def device_key(device: str) -> str:
    """The identity as the name of a file: lower-case letters, digits and hyphens; empty without an identity."""
    known = identity(device)
    words = re.sub(r"[^a-z0-9]+", "-", known.lower()).strip("-")[:60]
    return (
        f"device-{words}-{hashlib.sha256(known.encode('utf-8', 'surrogateescape')).hexdigest()[:12]}" if known else ""
    )


def _serial_number(entry: Path) -> str:
    """Maker, product and serial number of the USB device that a device belongs to; empty if it has none."""
    folder = Path(os.path.realpath(entry / "device"))
    for place in (folder, *folder.parents[:_ABOVE]):
        try:
            words = [(place / name).read_text().strip() for name in ("idVendor", "idProduct", "serial")]
        except (OSError, UnicodeDecodeError):
            continue
        return f"usb {' '.join(words)}"
    return ""


DEVICE_FLAGS = ("--serial", "--source")
"""Flags of programs and services that name hardware."""


@contextlib.asynccontextmanager
async def leased(
    cid: int | None,
    user: str,
    say: Callable[[str], None],
    patience_s: float = leases.DEFAULT_PATIENCE_S,
    devices: Sequence[str] = (),
) -> AsyncIterator[tuple[int, ...]]:
    """Holds the leases that tests on the rig take, too: of its CID and its devices. The emulated rig has neither.

    Gives the descriptors by which a program holds them, too. Raises LeaseTimeout when one does not come free.
    """
    held = await taken(cid, user, say, patience_s, devices)
    try:
        yield tuple(lease.descriptor for lease in held)
    finally:
        release(held)


async def taken(
    cid: int | None, user: str, say: Callable[[str], None], patience_s: float, devices: Sequence[str]
) -> list[leases.Lease]:
    """The same leases, to be released; all or, with LeaseTimeout, none."""
    held: list[leases.Lease] = []
    try:
        for name in [*([] if cid is None else [f"cid-{cid}"]), *device_leases(devices)]:
            held.append(await leases.lease_any([name], {"test": user}, say, patience_s=patience_s))
    except BaseException:
        release(held)
        raise
    return held


def release(held: Sequence[leases.Lease]) -> None:
    """Gives leases back, the last one first."""
    for lease in reversed(held):
        lease.release()


def devices_in(words: Iterable[str]) -> list[str]:
    """The hardware that flags ``--name=value`` name."""
    return [value for flag, _, value in (word.partition("=") for word in words) if flag in DEVICE_FLAGS]


def devices_of(plan: Plan) -> list[str]:
    """The hardware that a test's services use."""
    return devices_in(f"--{flag.name}={flag.value}" for service in plan.services for flag in service.flags)


def device_leases(devices: Sequence[str]) -> list[str]:
    """A lease's name for each device file, by its numbers: two rigs that name one device exclude each other.

    A port of this machine behind a socket is a device, too.
    """
    names = {f"device-{identity(device).replace(' ', '-')}" for device in devices if device.startswith("socket://")}
    for device in devices:
        with contextlib.suppress(OSError, ValueError):
            found = Path(device).stat()
            if device.startswith("/") and stat.S_ISCHR(found.st_mode):
                names.add(f"device-{os.major(found.st_rdev)}-{os.minor(found.st_rdev)}")
    return sorted(names)


FOLDER_VARIABLE = "DODO_RIGS"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


def quarantine_folder(is_hardware: bool = False) -> Path:
    """Where quarantines are: the operator's folder, else ``DODO_RIGS``, else in this user's state; raises RigProblem.

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
    keys = sorted({device_key(device) for device in devices} - {""})
    place = quarantine_folder(any(map(is_hardware_device, devices)))
    return [place / f"{key}.json" for key in (rig, *keys)]


def quarantined(rig: str, devices: Sequence[str] = ()) -> str:
    """Why a rig or one of its devices is in quarantine; empty when none is. Raises RigProblem."""
    reasons = (reason for file in _files(rig, devices) if (reason := _read(file)[1]))
    return next(reasons, "")


def all_quarantined() -> dict[str, str]:
    """The rigs in quarantine, each with its reason; raises RigProblem."""
    places = {quarantine_folder()}
    with contextlib.suppress(RigProblem):
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
