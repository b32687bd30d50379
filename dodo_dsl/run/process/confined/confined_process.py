"""A program of the application in its own sandbox, with the interface of subprocess.Popen that ``Children`` uses."""

import errno
import functools
import json
import os
import resource
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.confined import bubblewrap, launcher, seccomp_filter
from dodo_dsl.run.process.confined.confinement import FIRST_USER, Confinement
from dodo_dsl.run.process.confined.places import Places
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_SIGNALLED = range(129, 129 + 64)
"""Exit codes by which bubblewrap tells the signal that ended the program."""


def user_of(cid: int) -> int | None:
    """Who the application is where DoDo is root; None without root, when it is the user who runs DoDo."""
    return FIRST_USER + cid if os.getuid() == 0 else None


class ConfinedProcess:
    """``pid`` is that of bubblewrap, which ends with the program and gives its exit code."""

    def __init__(
        self,
        words: Sequence[str],
        environment: Mapping[str, str],
        output: int,
        confined: Confinement,
        places: Places | None,
        umask: int = -1,
    ) -> None:
        """``places`` is None on the host. Raises OSError, SubprocessError, ValueError and NoSeccomp."""
        program = _found(words[0], environment, confined.folder)
        user = user_of(confined.cid) if places else None
        mounts = _mounts(places, confined) if places else None
        given = {**environment, "PWD": confined.folder, **({"HOME": bubblewrap.HOME} if mounts else {})}
        self._status, status = os.pipe()
        filter_fd = seccomp_filter.descriptor() if places else os.open(os.devnull, os.O_RDONLY)
        source = launcher.variables(given)
        sandbox = bubblewrap.words(confined, mounts, program, user, filter_fd, status)
        try:
            self._process = subprocess.Popen(
                [*sandbox, *launcher.words(source, program), *words],
                env={"PATH": os.environ.get("PATH", os.defpath)},
                cwd=confined.folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                umask=umask,
                pass_fds=(filter_fd, status, source),
                preexec_fn=functools.partial(_limit, confined.limits, os.getpid()),  # noqa: PLW1509  (it has one thread)
            )
        except BaseException:
            os.close(self._status)
            raise
        finally:
            for descriptor in (status, filter_fd, source):
                os.close(descriptor)
        self.pid = self._process.pid
        self.memory = confined.limits.memory
        self.failed = False
        """Whether the sandbox could not be set up; known after ``wait``."""

    def wait(self) -> int:
        """The program's exit code, below 0 for the signal that ended it."""
        code = self._process.wait()
        with os.fdopen(self._status, "rb") as status:
            told = status.read().decode(errors="replace")
        self.failed = code > 0 and not any("exit-code" in json.loads(line) for line in told.splitlines())
        return 128 - code if code in _SIGNALLED else code


def _mounts(places: Places, confined: Confinement) -> bubblewrap.Mounts:
    reads = {path: places.read(path) for path in confined.reads}
    return bubblewrap.Mounts(*places.folder(confined.folder), places.home, places.shared, reads)


def _found(name: str, environment: Mapping[str, str], folder: str) -> str:
    """The path of a program; raises FileNotFoundError and PermissionError as starting it would."""
    path = Path(folder, name) if "/" in name else None
    found = shutil.which(path or name, path=environment.get("PATH", os.defpath))
    if found is None:
        number = errno.EACCES if path and path.exists() else errno.ENOENT
        raise OSError(number, os.strerror(number), name)
    return str(Path(folder, found))


def _limit(limits: SandboxLimits, parent: int) -> None:
    """Between fork and exec."""
    namespaces.end_with(parent)
    for kind, most in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NPROC, limits.processes),
        (resource.RLIMIT_NOFILE, limits.files),
        (resource.RLIMIT_FSIZE, limits.file_size),
        (resource.RLIMIT_DATA, 2 * limits.memory),  # what memory_watch would see too late
    ):
        _, hard = resource.getrlimit(kind)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (allowed, allowed))
