"""Leases: what one test of a machine has and others wait for, such as a CID, a rig's device, or the machine alone.

Who has a lease has locked its file (flock(2)), as every process that inherited the descriptor: a killed holder has
nothing any more, and the file says what is to be removed.
"""

import asyncio
import contextlib
import errno
import fcntl
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.run.protocol import BackendError
from dodo_dsl.state_folder import secured, shared_path

FOLDER_VARIABLE = "DODO_LEASES"
DEFAULT_PATIENCE_S = 600.0
CID, RUN, PROJECT = "cid-", "run-", "docker-"
"""Prefixes of the leases whose dead holders may have left something: their files stay until it is removed."""
_LOCKS = Path("/run/lock")
_MODE = 0o660
_RETRY_S = 0.2
_ENDING = ".lease"
_MOST_BYTES = 1 << 16


class LeaseTimeout(BackendError):
    """Waiting for a lease took too long; the text names the holder."""


@dataclass(frozen=True)
class Lease:
    """A held lease, also of a process that inherits ``descriptor``. ``left`` is what a dead holder's file says."""

    name: str
    descriptor: int
    record: Path
    left: Mapping[str, Any] = field(default_factory=dict)

    def release(self) -> None:
        """Gives up this process's hold, and leaves nothing to be removed."""
        with contextlib.suppress(OSError):  # the next run removes the rest
            fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # nobody shares it
            self.record.unlink(missing_ok=True)
        os.close(self.descriptor)

    def leave(self) -> None:
        """Gives up this process's hold and leaves the lease to those that inherited it."""
        os.close(self.descriptor)


def lease_folder() -> Path:
    """This user's lease folder, into which no other user can write; raises OSError if one can.

    It is the one that root made for all users, else the one in ``DODO_LEASES``.
    """
    if (shared := shared_path("leases")) is not None:
        return secured(shared)
    if wanted := os.environ.get(FOLDER_VARIABLE):
        return secured(Path(wanted))
    own = f"dodo-{os.geteuid()}"
    above = _LOCKS if (_LOCKS / own).exists() or os.access(_LOCKS, os.W_OK) else Path("/tmp")
    return secured(above / own)


def _locked(path: Path, kind: int, *, is_made: bool) -> int | None:
    """The locked descriptor of a file that is there, or else made; None if it is held, or another user's alone."""
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC | (os.O_CREAT if is_made else 0)
    while True:
        try:
            descriptor = os.open(path, flags, _MODE)
        except PermissionError:
            return None
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise OSError(errno.EINVAL, "expected a file", str(path))  # noqa: TRY301
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):  # its holder has just removed it
                if os.path.samestat(os.fstat(descriptor), path.stat()):
                    return descriptor
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _said(descriptor: int) -> dict[str, Any]:
    """What a file says about its holder; nothing if it is damaged."""
    with contextlib.suppress(ValueError, RecursionError):
        said = json.loads(os.pread(descriptor, _MOST_BYTES, 0))
        return said if isinstance(said, dict) else {}
    return {}


def try_lease(name: str, about: dict[str, Any], shared: bool = False) -> Lease | None:
    """The lease when nobody has it, else None. Shared leases exclude only exclusive ones."""
    path = lease_folder() / f"{name}{_ENDING}"
    descriptor = _locked(path, fcntl.LOCK_SH if shared else fcntl.LOCK_EX, is_made=True)
    if descriptor is None:
        return None
    lease = Lease(name, descriptor, path, _said(descriptor))
    try:
        with contextlib.suppress(OSError):  # of another user, or of a group that this one is not in
            os.fchmod(descriptor, _MODE)  # whatever the umask is
            os.fchown(descriptor, -1, path.parent.stat().st_gid)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps({"pid": os.getpid(), **about}).encode(), 0)
    except OSError:
        lease.release()
        raise
    return lease


def holder(name: str) -> str:
    """The holder of a lease, for a message; empty if nobody holds it."""
    path = lease_folder() / f"{name}{_ENDING}"
    with contextlib.suppress(OSError):
        if (descriptor := _locked(path, fcntl.LOCK_EX, is_made=False)) is not None:
            os.close(descriptor)
            return ""
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        about = _said(descriptor)
        os.close(descriptor)
        return f"test {about.get('test', '?')} of process {about['pid']}" if "pid" in about else "another process"
    return "another process" if path.exists() else ""


async def lease_any(
    names: Sequence[str],
    about: dict[str, Any],
    waiting: Callable[[str], None],
    shared: bool = False,
    patience_s: float = DEFAULT_PATIENCE_S,
    attempt: Callable[[str, dict[str, Any], bool], Lease | None] = try_lease,
) -> Lease:
    """The first of the leases that is free, which ``attempt`` takes; ``waiting`` gets a sentence if none is.

    Raises LeaseTimeout when one holder has kept it for ``patience_s``. Times are of the event loop's clock, in s.
    """
    now = asyncio.get_running_loop().time
    deadline, held_by = 0.0, ""
    while (lease := next((found for name in names if (found := attempt(name, about, shared))), None)) is None:
        holds = holder(names[0]) or "another process"
        if not held_by:
            waiting(f"waiting for {holds}")
        if holds != held_by:
            deadline, held_by = now() + patience_s, holds
        if now() > deadline:
            kind = names[0].partition("-")[0]
            raise LeaseTimeout(f"no {kind} came free within {patience_s:g} s; {holds} holds one")
        await asyncio.sleep(_RETRY_S)
    return lease


def orphans(prefix: str) -> Iterator[Lease]:
    """This user's leases whose holders have ended and may have left something; each is yielded held."""
    for path in sorted(lease_folder().glob(f"{prefix}*{_ENDING}")):
        with contextlib.suppress(OSError):
            descriptor = _locked(path, fcntl.LOCK_EX, is_made=False)
            if descriptor is not None and os.fstat(descriptor).st_uid == os.getuid():
                yield Lease(path.name.removesuffix(_ENDING), descriptor, path, _said(descriptor))
            elif descriptor is not None:
                os.close(descriptor)
