"""Leases: lock files that die with their holder, and the queue for them.

They are for CIDs, shared-memory prefixes and running alone. A lease is a ``flock`` on an open file, held by every
process that inherited the descriptor. Beside it lies a record of what it covers, so that the next run can remove what a
killed holder left.

The queue is first come, first served, between all processes that share a lease folder. Each waiter has a ticket: a file
that it locks, whose name begins with the time of its arrival. Nobody takes a lease for which an earlier ticket waits.
The lock of a waiter that dies goes with it, so that the others skip its ticket.
"""

import asyncio
import contextlib
import contextvars
import errno
import fcntl
import itertools
import json
import os
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from dodo_dsl.opendlv import regular_file
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.machine import machine
from dodo_dsl.state_folder import secured

PREFIX = "queue."
_BORN_S = 10.0
"""A ticket without content is being written, or was left half written when it is older."""
_NUMBERS = itertools.count()
_ARRIVAL: contextvars.ContextVar[int | None] = contextvars.ContextVar("arrival", default=None)
_NO_TICKET = (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError)


@dataclass(frozen=True)
class Ticket:
    """A process that waits since a time in ns for any of some leases; ``shared`` excludes only exclusive use.

    The holder of the ``turn`` has chosen a rig and is about to take all of its leases: later ones choose another.
    """

    since: int
    names: frozenset[str]
    shared: bool
    turn: bool

    def precedes(self, since: int, names: Collection[str], shared: bool) -> bool:
        """Whether a process that came at a time may take none of the names before this one."""
        return self.since < since and not (self.shared and shared) and not self.names.isdisjoint(names)


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
def ticket(
    folder: Path, names: Sequence[str], since: int, *, shared: bool = False, turn: bool = False
) -> Iterator[None]:
    """Waits in the queue within the block; raises OSError if the folder cannot be written."""
    path = folder / f"{PREFIX}{since:020d}.{os.getpid()}.{next(_NUMBERS)}"
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, _MODE)
    try:
        os.fchmod(descriptor, _MODE)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.write(descriptor, json.dumps({"names": list(names), "shared": shared, "turn": turn}).encode())
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(descriptor)


def ahead_in_line(folder: Path, names: Collection[str], since: int, *, shared: bool = False) -> list[Ticket]:
    """The processes that wait for one of the names and came before ``since``; tickets of dead processes are removed."""
    return [one for one in _waiting(folder) if one.precedes(since, names, shared)]


def remove_dead(folder: Path) -> None:
    """Removes the tickets of processes that have ended."""
    for _ in _waiting(folder):
        pass


def _waiting(folder: Path) -> Iterator[Ticket]:
    for path in sorted(folder.glob(f"{PREFIX}*")):
        with contextlib.suppress(*_NO_TICKET):
            since = int(path.name.split(".")[1])
            if _is_dead(path):
                path.unlink(missing_ok=True)
                continue
            about = json.loads(regular_file.text(path))
            yield Ticket(since, frozenset(map(str, about["names"])), bool(about["shared"]), bool(about["turn"]))


def _is_dead(path: Path) -> bool:
    """Whether nobody holds a ticket any more, and it is not being written; raises OSError if it cannot be opened."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    else:
        status = os.fstat(descriptor)
        return bool(status.st_size) or time.time() - status.st_mtime > _BORN_S
    finally:
        os.close(descriptor)


FOLDER_VARIABLE = "DODO_LEASES"
DEFAULT_PATIENCE_S = 600.0
RUN, PROJECT = "run-", "docker-"
ONCE = (RUN, PROJECT)
"""Prefixes of leases with random names: nobody ever waits for one, so their lock files are removed."""
_LOCKS = Path("/run/lock")
_MODE = 0o660
_RETRY_S = 0.2
_NO_RECORD = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)
"""Raised by reading a record that is damaged or was written by another program."""


Taken = TypeVar("Taken")


class LeaseTimeout(BackendError):
    """Waiting for a lease took too long; the text names the holder."""


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


@dataclass(frozen=True)
class Lease:
    """A held lock; a process that inherits ``descriptor`` holds it, too."""

    name: str
    descriptor: int
    record: Path

    def release(self) -> None:
        """Gives up this process's hold and removes the record, and the lock file where its name is never used again."""
        with contextlib.suppress(OSError):  # the next run removes the rest
            self.record.unlink(missing_ok=True)
            if self.name.startswith(ONCE):
                _lock_file(self.name).unlink(missing_ok=True)
        os.close(self.descriptor)

    def leave(self) -> None:
        """Gives up this process's hold and leaves record and lock to those that inherited it."""
        os.close(self.descriptor)


def _lock_file(name: str) -> Path:
    return lease_folder() / f"{name}.lock"


def _open(name: str) -> int:
    """Opens the lock file, or creates it: kernels refuse O_CREAT on another user's file in a sticky folder."""
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    while True:
        try:
            return os.open(_lock_file(name), flags)
        except FileNotFoundError:
            with contextlib.suppress(FileExistsError):
                descriptor = os.open(_lock_file(name), flags | os.O_CREAT | os.O_EXCL, _MODE)
                os.fchmod(descriptor, _MODE)
                return descriptor


def try_lease(name: str, about: dict[str, Any], shared: bool = False) -> Lease | None:
    """The lease when it is free, else None. Shared leases exclude only exclusive ones."""
    descriptor = _open(name)
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            return None
        raise
    record = lease_folder() / f"{name}.{os.getpid()}.json"
    try:
        _write_new(record, json.dumps({"pid": os.getpid(), **about}))
    except OSError:
        os.close(descriptor)
        raise
    return Lease(name, descriptor, record)


def is_free(name: str) -> bool:
    """Whether nobody holds a lease."""
    descriptor = _open(name)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    finally:
        os.close(descriptor)
    return True


def _write_new(record: Path, text: str) -> None:
    """Writes a record that nobody can have put there, in the place of one that an earlier process of this id left."""
    record.unlink(missing_ok=True)
    descriptor = os.open(record, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, _MODE)
    try:
        os.write(descriptor, text.encode())
    finally:
        os.close(descriptor)


def holder(name: str) -> str:
    """The holder of a lease, for a message; its record may be another user's."""
    for record in sorted(lease_folder().glob(f"{name}.*.json")):
        with contextlib.suppress(OSError, *_NO_RECORD):
            about = json.loads(regular_file.text(record))
            if _is_alive(int(about["pid"])):
                return f"test {about.get('test', '?')} of process {about['pid']}"
    return "another process"


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True  # another user's process
    return True


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
    place, since = lease_folder(), arrival_time()

    def may_take(name: str) -> bool:
        """A process about to take all leases of a rig holds up nobody here: others may hold what it still needs."""
        return all(one.turn for one in ahead_in_line(place, (name,), since, shared=shared))

    def take() -> Lease | None:
        free = (name for name in names if may_take(name))
        return next((lease for name in free if (lease := attempt(name, about, shared))), None)

    if lease := take():
        return lease
    with ticket(place, names, since, shared=shared):
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
        before = sum(not one.turn for one in ahead_in_line(lease_folder(), names, since, shared=shared))
        if before < known:
            deadline = now() + patience_s
        if now() > deadline:
            said = f"no {_kind(names)} came free within {patience_s:g} s; {holder(names[0])} holds one"
            raise LeaseTimeout(f"{said}, {_others(before)}" if before else said)
        if before < known or known < 0:
            waiting(f"waiting for {holder(names[0])}" + (f", {_others(before)}" if before else ""))
            known = before
        await asyncio.sleep(_RETRY_S)
    return taken


def _others(number: int) -> str:
    return f"and {number} {'waits' if number == 1 else 'wait'} before this one"


def _kind(names: Sequence[str]) -> str:
    return names[0].partition("-")[0]


def orphans(prefix: str) -> Iterator[tuple[Lease, dict[str, Any]]]:
    """This user's leases that nobody holds but whose record is still there; each is yielded held, with its record."""
    for record in sorted(lease_folder().glob(f"{prefix}*.json")):
        name = record.name.split(".")[0]
        with contextlib.suppress(OSError):
            if record.lstat().st_uid != os.getuid():
                continue
            about = _about(record)
            descriptor = _open(name)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(descriptor)
                continue
            yield Lease(name, descriptor, record), about


def _about(record: Path) -> dict[str, Any]:
    """The content of a record; empty when its writer was killed before it was complete."""
    with contextlib.suppress(*_NO_RECORD):
        about = json.loads(regular_file.text(record))
        return about if isinstance(about, dict) else {}
    return {}


def forget_dead() -> None:
    """Removes the records of machine leases, and the tickets, whose process has ended; their locks ended with it."""
    remove_dead(lease_folder())
    for record in lease_folder().glob("machine.*.json"):
        with contextlib.suppress(OSError, *_NO_RECORD):
            if not Path("/proc", str(int(json.loads(regular_file.text(record))["pid"]))).exists():
                record.unlink(missing_ok=True)
