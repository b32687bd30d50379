"""A program of the application in its own sandbox."""

import contextlib
import errno
import functools
import os
import resource
import shutil
import subprocess
from pathlib import Path

from dodo_dsl.run.process import confinement, namespaces, process_group, seccomp_filter
from dodo_dsl.run.process.confinement import PROGRAM, Command, Confinement
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.process_group import ProcessGroup
from dodo_dsl.run.process.slot import in_memory
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_SIGNALLED = range(129, 129 + 64)
"""Exit codes by which bubblewrap reports the signal that ended the program."""
_BEGAN = b'"exit-code"'
"""What bubblewrap reports only of a program that it could start (``--json-status-fd``)."""


def start(
    command: Command, confined: Confinement, output: int, places: Places | None, umask: int
) -> tuple[subprocess.Popen[bytes], int, ProcessGroup | None]:
    """Bubblewrap's process, which ends with the program and gives its exit code, and a descriptor for ``ended``.

    ``places`` is None on the host. Raises OSError, SubprocessError and ValueError.
    """
    name, path = command.argv[0], Path(confined.folder, command.argv[0])
    found = shutil.which(path if "/" in name else name, path=command.environment.get("PATH", os.defpath))
    if found is None:
        number = errno.EACCES if "/" in name and path.exists() else errno.ENOENT
        raise OSError(number, os.strerror(number), name)
    program = str(Path(confined.folder, found))
    user = places.user if places else None
    given = {**command.environment, **({"HOME": confinement.HOME} if places else {})}
    others = 0 if user is not None else _threads_of_this_user()
    sandbox = confinement.sandbox_words(confined, places, program, given, command.masked)
    group = process_group.make(confined.limits.processes)
    said, status = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        with contextlib.ExitStack() as stack:
            passed = {"--json-status-fd": stack.enter_context(os.fdopen(status, "wb")).fileno()}
            if places:
                passed["--seccomp"] = stack.enter_context(in_memory(seccomp_filter.program())).fileno()
            if places and places.namespace is not None:  # which bubblewrap closes as it closes what it waited for
                passed |= {"--userns": places.namespace, "--block-fd": places.namespace}
            sandbox += [word for name, descriptor in passed.items() for word in (name, str(descriptor))]
            with in_memory(confinement.as_data(sandbox)) as words:
                process = subprocess.Popen(
                    [PROGRAM, "--args", str(words.fileno()), "--", program, *command.argv[1:]],
                    env={"PATH": os.environ.get("PATH", os.defpath)},
                    cwd="/",
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    start_new_session=True,
                    umask=umask,
                    user=user,
                    group=user,
                    extra_groups=None if user is None else [],
                    pass_fds=(*passed.values(), words.fileno()),
                    preexec_fn=functools.partial(_limit, confined.limits, os.getpid(), group, others),  # noqa: PLW1509
                )
    except BaseException:
        os.close(said)
        if group:
            group.remove()
        raise
    return process, said, group


def ended(said: int, code: int) -> tuple[int, bool]:
    """The program's exit code by bubblewrap's, below 0 for the signal that ended it, and whether it never began."""
    with os.fdopen(said, "rb") as file:
        began = _BEGAN in (file.read() or b"")  # None if what it was to start has not ended yet
    return 128 - code if code in _SIGNALLED else code, code > 0 and not began


def _limit(limits: SandboxLimits, parent: int, group: ProcessGroup | None, others: int) -> None:
    """Between fork and exec. Without a group the kernel counts processes by user, ``others`` of this one among them."""
    namespaces.begin(parent)
    kinds = {
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NOFILE: limits.files,
        resource.RLIMIT_FSIZE: limits.file_size,
        resource.RLIMIT_DATA: 2 * limits.memory,  # what memory_watch would see too late
    }
    if group is None or not group.join():
        kinds[resource.RLIMIT_NPROC] = limits.processes + process_group.OURS + 2 * others
    for kind, most in kinds.items():
        _, hard = resource.getrlimit(kind)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (allowed, allowed))


def _threads_of_this_user() -> int:
    """As many as are seen: in a sandbox its own, of which alone the kernel counts there (since Linux 5.14)."""
    threads = 0
    for entry in Path("/proc").glob("[0-9]*/task"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            threads += entry.stat().st_nlink - 2 if entry.stat().st_uid == os.getuid() else 0
    return threads
