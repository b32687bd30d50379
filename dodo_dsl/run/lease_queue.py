"""The queue for leases: who waits for one, first come, first served, between all processes that share a lease folder.

Each waiter has a ticket: a file that it locks, whose name begins with the time of its arrival. Nobody takes a lease for
which an earlier ticket waits. The lock of a waiter that dies goes with it, so that the others skip its ticket.
"""

import contextlib
import contextvars
import fcntl
import itertools
import json
import os
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.opendlv import regular_file

PREFIX = "queue."
_MODE = 0o660
_BORN_S = 10.0
"""A ticket without content is being written, or was left half written when it is older."""
_NUMBERS = itertools.count()
_ARRIVAL: contextvars.ContextVar[int | None] = contextvars.ContextVar("arrival", default=None)
_NO_TICKET = (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError)


@dataclass(frozen=True)
class Ticket:
    """Somebody who waits since a time in ns for any of some leases; a ``shared`` one excludes only exclusive use.

    Who has the ``turn`` has chosen a rig and is about to take all of its leases: those who choose later take another.
    """

    since: int
    names: frozenset[str]
    shared: bool
    turn: bool

    def precedes(self, since: int, names: Collection[str], shared: bool) -> bool:
        """Whether one who came at a time may take none of the names before this one."""
        return self.since < since and not (self.shared and shared) and not self.names.isdisjoint(names)


def now() -> int:
    """The time of arrival of who comes now: in ns, of a clock that all processes of a machine share.

    Within ``arrived`` it is the time at which its block was entered.
    """
    return _ARRIVAL.get() or time.monotonic_ns()


@contextlib.contextmanager
def arrived() -> Iterator[None]:
    """Everything that is waited for within the block keeps the place in the queue that its beginning has."""
    before = _ARRIVAL.set(now())
    try:
        yield
    finally:
        _ARRIVAL.reset(before)


@contextlib.contextmanager
def ticket(
    folder: Path, names: Sequence[str], since: int, *, shared: bool = False, turn: bool = False
) -> Iterator[None]:
    """Waits in the queue within the block; raises OSError where the folder cannot be written."""
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


def ahead(folder: Path, names: Collection[str], since: int, *, shared: bool = False) -> list[Ticket]:
    """Who waits for one of the names and came before ``since``; tickets of dead processes are removed."""
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
    """Whether nobody holds a ticket any more, and it is not being written; raises OSError where it cannot be opened."""
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
