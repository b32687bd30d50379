"""Leases: what one test of a machine has and others wait for, such as a CID, a rig's device, or the machine alone.

Who has a lease, and who waits for some, is a file in the lease folder, with a ``flock`` that every process holds which
inherited the descriptor: a killed holder has nothing any more, and its file says what the next run has to remove. Who
has a lease came before all others; of those who wait, nobody takes one for which an earlier one waits.
"""

import asyncio
import contextlib
import contextvars
import fcntl
import io
import os
import secrets
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from dodo_dsl.opendlv import regular_file
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.machine import machine
from dodo_dsl.state_folder import secured

FOLDER_VARIABLE = "DODO_LEASES"
DEFAULT_PATIENCE_S = 600.0
CID, RUN, PROJECT = "cid-", "run-", "docker-"
"""Prefixes of the leases whose dead holders may have left something: their files stay until it is removed."""
_QUEUE, _LOCK = "queue", "leases.lock"
_LOCKS = Path("/run/lock")
_MODE = 0o660
_RETRY_S = 0.2
_ENDING = ".lease"
_NO_CLAIM = (FileNotFoundError, IsADirectoryError, regular_file.NotAFile)
"""Raised by opening what is gone meanwhile, or what no holder has put there."""
_ARRIVAL: contextvars.ContextVar[int | None] = contextvars.ContextVar("arrival", default=None)
Taken = TypeVar("Taken")


class LeaseTimeout(BackendError):
    """Waiting for a lease took too long; the text names the holder."""


class Claim(msgspec.Struct, frozen=True):
    """Who has or waits for one of some leases; ``shared`` excludes only exclusive use.

    The holder of the ``turn`` has chosen a rig and is about to take all of its leases: later ones choose another.
    """

    names: frozenset[str]
    since: int = 0
    """When it came, in ns; 0 for who has a lease."""
    shared: bool = False
    turn: bool = False
    about: dict[str, Any] = {}


@dataclass(frozen=True)
class Lease:
    """A held lease; a process that inherits ``descriptor`` holds it, too."""

    name: str
    descriptor: int
    record: Path

    def release(self) -> None:
        """Gives up this process's hold, and leaves nothing to be removed."""
        with contextlib.suppress(OSError):  # the next run removes the rest
            self.record.unlink(missing_ok=True)
        os.close(self.descriptor)

    def leave(self) -> None:
        """Gives up this process's hold and leaves the lease to those that inherited it."""
        os.close(self.descriptor)


def lease_folder() -> Path:
    """This user's lease folder, into which no other user can write; raises OSError if one can.

    It is the one that the machine's operator named for its rigs, else the one in ``DODO_LEASES``.
    """
    if (operators := machine()) is not None and operators.leases is not None:
        return secured(operators.leases)
    if wanted := os.environ.get(FOLDER_VARIABLE):
        return secured(Path(wanted))
    own = f"dodo-{os.geteuid()}"
    above = _LOCKS if (_LOCKS / own).exists() or os.access(_LOCKS, os.W_OK) else Path("/tmp")
    return secured(above / own)


def arrival_time() -> int:
    """The time of arrival of a process that comes now: in ns, of a clock that all processes of a machine share.

    Within ``arrived`` it is the time at which its block was entered.
    """
    return _ARRIVAL.get() or time.monotonic_ns()


@contextlib.contextmanager
def arrived() -> Iterator[None]:
    """Everything that is waited for within the block keeps the place in the queue that its beginning has."""
    before = _ARRIVAL.set(arrival_time())
    try:
        yield
    finally:
        _ARRIVAL.reset(before)


@contextlib.contextmanager
def _alone() -> Iterator[Path]:
    """The lease folder, in which nobody else looks or writes meanwhile; not to be nested."""
    path = lease_folder() / _LOCK
    with contextlib.suppress(FileExistsError):
        os.close(_created(path))
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield path.parent
    finally:
        os.close(descriptor)


def _created(path: Path) -> int:
    """The descriptor of a new file, which all users of the folder can read and write, whatever the umask is."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, _MODE)
    os.fchmod(descriptor, _MODE)
    with contextlib.suppress(OSError):  # of a group that this user is not in
        os.fchown(descriptor, -1, path.parent.stat().st_gid)
    return descriptor


def _written(path: Path, claim: Claim) -> int:
    """The locked descriptor of a new file."""
    descriptor = _created(path)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.write(descriptor, msgspec.json.encode(claim))
    except OSError:
        path.unlink(missing_ok=True)
        os.close(descriptor)
        raise
    return descriptor


def _read(file: io.FileIO, path: Path) -> Claim:
    """What a file says; of one that is damaged, what its name does."""
    with contextlib.suppress(msgspec.DecodeError, RecursionError):
        return msgspec.json.decode(file.read(), type=Claim)
    return Claim(frozenset({path.name.partition(".")[0]}))


def _lock(file: io.FileIO, kind: int) -> bool:
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(file.fileno(), kind | fcntl.LOCK_NB)
        return True
    return False


def _claims(folder: Path) -> Iterator[Claim]:
    """Those of living processes; what dead ones waited for is removed, and what they had and cannot have left."""
    for path in sorted(folder.glob(f"*{_ENDING}")):
        try:
            with contextlib.suppress(*_NO_CLAIM), regular_file.opened(path) as file:
                if not _lock(file, fcntl.LOCK_SH):
                    yield _read(file, path)
                elif not path.name.startswith((CID, RUN, PROJECT)):
                    with contextlib.suppress(OSError):  # another user's, in a sticky folder
                        path.unlink(missing_ok=True)
        except PermissionError:
            yield Claim(frozenset({path.name.partition(".")[0]}))


def ahead(names: Collection[str], since: int, shared: bool = False) -> list[Claim]:
    """Those who have one of the names, or came for one before ``since``."""
    with _alone() as folder:
        return [
            one for one in _claims(folder)
            if one.since < since and not (one.shared and shared) and not one.names.isdisjoint(names)
        ]  # fmt: skip


def try_lease(name: str, about: dict[str, Any], shared: bool = False) -> Lease | None:
    """The lease when nobody has it, else None. Shared leases exclude only exclusive ones."""
    with _alone() as folder:
        if any(name in one.names and not (one.since or (one.shared and shared)) for one in _claims(folder)):
            return None
        path = folder / f"{name}.{secrets.token_hex(8)}{_ENDING}"
        claim = Claim(frozenset({name}), 0, shared, about={"pid": os.getpid(), **about})
        return Lease(name, _written(path, claim), path)


@contextlib.contextmanager
def ticket(names: Collection[str], since: int, *, shared: bool = False, turn: bool = False) -> Iterator[None]:
    """Waits in the queue within the block; raises OSError if the folder cannot be written."""
    with _alone() as folder:
        path = folder / f"{_QUEUE}.{since:020d}.{secrets.token_hex(8)}{_ENDING}"
        waits = Lease(_QUEUE, _written(path, Claim(frozenset(names), since, shared, turn)), path)
    try:
        yield
    finally:
        waits.release()


def holder(name: str) -> str:
    """The holder of a lease, for a message; its file may be another user's."""
    with contextlib.suppress(OSError):
        found = (one.about for one in ahead([name], 1) if "pid" in one.about)
        return next((f"test {about.get('test', '?')} of process {about['pid']}" for about in found), "another process")
    return "another process"


async def lease_any(
    names: Sequence[str],
    about: dict[str, Any],
    waiting: Callable[[str], None],
    shared: bool = False,
    patience_s: float = DEFAULT_PATIENCE_S,
    attempt: Callable[[str, dict[str, Any], bool], Lease | None] = try_lease,
) -> Lease:
    """The first of the leases that is free, in turn: nobody gets one before those that came earlier.

    ``attempt`` takes one. ``waiting`` is called with a sentence whenever fewer are ahead. Raises LeaseTimeout when the
    queue has not moved for ``patience_s``. Times are of the event loop's clock, in s.
    """
    since = arrival_time()

    def take() -> Lease | None:
        """A process about to take all leases of a rig holds up nobody here: others may hold what it still needs."""
        taken = frozenset[str]().union(*(one.names for one in ahead(names, since, shared) if not one.turn))
        free = (name for name in names if name not in taken)
        return next((lease for name in free if (lease := attempt(name, about, shared))), None)

    if lease := take():
        return lease
    with ticket(names, since, shared=shared):
        return await in_turn(take, names, waiting, shared, patience_s, since)


async def in_turn(
    take: Callable[[], Taken | None],
    names: Sequence[str],
    waiting: Callable[[str], None],
    shared: bool,
    patience_s: float,
    since: int,
) -> Taken:
    """What ``take`` gives as soon as it gives something; the rest as for ``lease_any``. The caller has a ticket."""
    now = asyncio.get_running_loop().time
    deadline, known = now() + patience_s, -1
    while (taken := take()) is None:
        before = sum(one.since > 0 and not one.turn for one in ahead(names, since, shared))
        others = f", and {before} {'waits' if before == 1 else 'wait'} before this one" if before else ""
        if before < known:
            deadline = now() + patience_s
        if now() > deadline:
            kind = names[0].partition("-")[0]
            raise LeaseTimeout(f"no {kind} came free within {patience_s:g} s; {holder(names[0])} holds one{others}")
        if before < known or known < 0:
            waiting(f"waiting for {holder(names[0])}{others}")
            known = before
        await asyncio.sleep(_RETRY_S)
    return taken


def orphans(prefix: str) -> Iterator[tuple[Lease, dict[str, Any]]]:
    """This user's leases whose holders have ended and may have left something; each is yielded held, and about what."""
    with _alone() as folder:
        paths = sorted(folder.glob(f"{prefix}*{_ENDING}"))
        list(_claims(folder))
    for path in paths:
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            stack.enter_context(_alone())
            file = stack.enter_context(regular_file.opened(path))
            if os.fstat(file.fileno()).st_uid == os.getuid() and _lock(file, fcntl.LOCK_EX):
                lease, about = Lease(path.name.partition(".")[0], os.dup(file.fileno()), path), _read(file, path).about
                stack.close()
                yield lease, about
