"""The leases of a rig: of its CID, and of its devices."""

import contextlib
import os
import stat
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from pathlib import Path

from dodo_dsl.run import lease_queue, leases
from dodo_dsl.run.rigs.devices import identity

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
        with lease_queue.arrived():
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
