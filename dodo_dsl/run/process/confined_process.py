"""A program of the application in its own sandbox, and whether this machine can confine it.

The process has the interface of subprocess.Popen that ``Children`` uses. Where an application cannot be confined, the
probe says whether the machine lacks what that takes.
"""

import contextlib
import errno
import functools
import os
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from dodo_dsl.run.process import confinement, namespaces, places, process_group, seccomp_filter
from dodo_dsl.run.process.confinement import INTERPRETER, PROGRAM, Confinement
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.process_group import ProcessGroup
from dodo_dsl.run.process.seccomp_filter import NoSeccomp
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_SIGNALLED = range(129, 129 + 64)
"""Exit codes by which bubblewrap reports the signal that ended the program."""


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
        user = places.user if places else None
        mounts = _mounts(places, confined) if places else None
        given = {**environment, "PWD": confined.folder, **({"HOME": confinement.HOME} if mounts else {})}
        others = 0 if user is not None else _threads_of_this_user()
        self._group = process_group.make(confined.limits.processes)
        self._began, began = os.pipe()
        filter_fd = seccomp_filter.descriptor() if places else os.open(os.devnull, os.O_RDONLY)
        source = confinement.launcher_variables(given)
        sandbox = confinement.sandbox_words(confined, mounts, program, user, filter_fd)
        limit = functools.partial(_limit, confined.limits, os.getpid(), self._group, others)
        try:
            self._process = subprocess.Popen(
                [*sandbox, *confinement.launcher_words(source, began, program), *words],
                env={"PATH": os.environ.get("PATH", os.defpath)},
                cwd=confined.folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                umask=umask,
                pass_fds=(filter_fd, began, source),
                preexec_fn=limit,  # noqa: PLW1509  (it has one thread)
            )
        except BaseException:
            self._close()
            raise
        finally:
            for descriptor in (began, filter_fd, source):
                os.close(descriptor)
        self.pid = self._process.pid
        self.failed = False
        """Whether the program never began; known after ``wait``."""

    def used_s(self) -> float | None:
        """Processor time in s, also of all that ended; None if it has no control group that counts it."""
        return self._group.used_s() if self._group else None

    def wait(self) -> int:
        """The program's exit code, below 0 for the signal that ended it."""
        code = self._process.wait()
        self.failed = os.read(self._began, 16) != confinement.BEGAN
        self._close()
        return 128 - code if code in _SIGNALLED else code

    def _close(self) -> None:
        os.close(self._began)
        if self._group is not None:
            self._group.remove()


def _mounts(places: Places, confined: Confinement) -> confinement.Mounts:
    reads = {path: places.read(path) for path in confined.reads}
    return confinement.Mounts(*places.folder(confined.folder), places.home, places.shared, places.mounted, reads)


def _found(name: str, environment: Mapping[str, str], folder: str) -> str:
    """The path of a program; raises FileNotFoundError and PermissionError as starting it would."""
    path = Path(folder, name) if "/" in name else None
    found = shutil.which(path or name, path=environment.get("PATH", os.defpath))
    if found is None:
        number = errno.EACCES if path and path.exists() else errno.ENOENT
        raise OSError(number, os.strerror(number), name)
    return str(Path(folder, found))


def _limit(limits: SandboxLimits, parent: int, group: ProcessGroup | None, others: int) -> None:
    """Between fork and exec. Without a group the kernel counts processes by user, ``others`` of this one among them."""
    namespaces.end_with(parent)
    if group is None or not group.join():
        _set_limit(resource.RLIMIT_NPROC, limits.processes + process_group.OURS + 2 * others)
    for kind, most in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NOFILE, limits.files),
        (resource.RLIMIT_FSIZE, limits.file_size),
        (resource.RLIMIT_DATA, 2 * limits.memory),  # what memory_watch would see too late
    ):
        _set_limit(kind, most)


def _set_limit(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (allowed, allowed))


def _threads_of_this_user(proc: Path = Path("/proc")) -> int:
    """As many as are seen: in a sandbox its own, of which alone the kernel counts there (since Linux 5.14)."""
    threads = 0
    for entry in proc.iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended meanwhile
                if entry.stat().st_uid == os.getuid():
                    threads += sum(1 for _ in (entry / "task").iterdir())
    return threads


BUBBLEWRAP, NAMESPACES = "bubblewrap", "namespaces"
_FOLDER = "/usr"


def confinement_problem() -> str:
    """What goes wrong when a program that does nothing is confined as an application is; empty when nothing does.

    To be called by a sandbox with own mounts.
    """
    with tempfile.TemporaryFile() as output:
        try:
            confined = Confinement(_FOLDER, "network", 0, INTERPRETER)
            true = ConfinedProcess(
                ["true"], {"PATH": os.defpath}, output.fileno(), confined, Places(places.own_user(0))
            )
            code = true.wait()
        except (OSError, subprocess.SubprocessError, NoSeccomp) as error:
            return str(error)
        output.seek(0)
        told = output.read(1000).decode(errors="replace").strip()
    return "" if code == 0 else told or f"exit code {code}"


def missing() -> str:
    """What confining takes and this machine lacks, each tried by itself: BUBBLEWRAP, NAMESPACES, or empty."""
    if shutil.which(PROGRAM) is None:
        return BUBBLEWRAP
    return NAMESPACES if namespaces.refusal() else ""


PERIOD_S = 0.25
