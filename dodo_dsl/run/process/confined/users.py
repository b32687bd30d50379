"""User ids that nobody else on the machine has, for applications that root starts.

The kernel counts processes, inotify instances and bytes of message queues by user, on the whole machine: in all
containers and namespaces, whose processes this one may not see. So an id is taken as long as a process has it.
"""

import contextlib
import errno
import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.run.process import namespaces

FIRST, LAST = 64_000, 64_999
HELD = 1
"""Processes of an own id that are not the application's: the one that holds it."""
_MOST_TRIES = 100
_FREE, _TAKEN = b"+", b"-"


def own(cid: int) -> int | None:
    """Who the application of a test is where DoDo is root, as nobody else is; None without root: who runs DoDo.

    Raises as ``lease``.
    """
    return lease(FIRST + cid) if os.getuid() == 0 else None


def lease(preferred: int) -> int:
    """An id that no process on the machine has, held by a child of this process until that is killed.

    The ``preferred`` one if it is free, else another. Raises OSError where none is, and where the kernel refuses.
    """
    known = _known_ids()
    for tries, user in enumerate(_in_turn(preferred)):
        if tries == _MOST_TRIES:
            break
        if user not in known and _is_held(user):
            return user
    raise OSError(errno.EAGAIN, f"no user id from {FIRST} to {LAST} is free: other processes on this machine have them")


def _in_turn(preferred: int) -> Iterator[int]:
    yield preferred
    yield from (user for user in range(FIRST, LAST + 1) if user != preferred)


def _known_ids(passwd: Path = Path("/etc/passwd")) -> set[int]:
    """The ids of the machine's own users."""
    with contextlib.suppress(OSError):
        fields = [line.split(":") for line in passwd.read_text(errors="replace").splitlines()]
        return {int(each[2]) for each in fields if len(each) > 2 and each[2].isdecimal()}
    return set()


def _is_held(user: int) -> bool:
    """Whether a new child is the only process with an id; it then stays. Raises OSError where it cannot be."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _hold(user, writer)
        finally:
            os._exit(1)
    os.close(writer)
    with os.fdopen(reader, "rb") as answers:
        answer = answers.read(4)
    if answer == _FREE:
        return True
    os.waitpid(child, 0)
    if answer == _TAKEN:
        return False
    number = int(answer or errno.EAGAIN)
    raise OSError(number, f"cannot take the user id {user}: {os.strerror(number)}")


def _hold(user: int, writer: int) -> None:
    """The child: it takes the id, then looks whether another has it, so that of two that try at once none is wrong."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.closerange(3, writer)
    os.closerange(writer + 1, 1 << 16)
    try:
        _, hard = resource.getrlimit(resource.RLIMIT_NPROC)
        resource.setrlimit(resource.RLIMIT_NPROC, (HELD + 1, hard))
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
        namespaces.die_with_parent(signal.SIGKILL)
    except OSError as error:
        os.write(writer, str(error.errno).encode())
        return
    if not _may_fork():
        os.write(writer, _TAKEN)
        return
    os.write(writer, _FREE)
    os.closerange(0, writer + 1)
    while True:
        signal.pause()


def _may_fork() -> bool:
    """Whether this user has no more processes than this one: with another the kernel refuses a second."""
    try:
        child = os.fork()
    except BlockingIOError:
        return False
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    return True
