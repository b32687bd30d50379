"""The processes of a sandbox: started or forked, collected when they end, and ended with all their descendants.

A Python module that is forked instead of started has what its parent has loaded already.
"""

import contextlib
import functools
import os
import runpy
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from dodo_dsl.run.machine_load.processes import above, living, owners
from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.confined_process import ConfinedProcess
from dodo_dsl.run.process.confinement import Confinement
from dodo_dsl.run.process.places import Places

_DESCRIPTORS = 65_536


class ForkedModule:
    """A child of this process, which has one thread; ``pid`` is that of its own session."""

    def __init__(self, words: Sequence[str], environment: Mapping[str, str], folder: str, output: int) -> None:
        """``words`` are ``python -m MODULE`` and its arguments; raises OSError when the folder cannot be entered."""
        Path(folder).stat()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _become(words, environment, folder, output)

    def wait(self) -> int:
        """Its exit code, below 0 for the signal that ended it, as in subprocess."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def _become(words: Sequence[str], environment: Mapping[str, str], folder: str, output: int) -> NoReturn:
    code = 1
    try:
        _set_up(environment, folder, output)
        sys.argv[:] = words[2:]
        runpy.run_module(words[2], run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = _exit_code(end)
    except BaseException:  # noqa: BLE001  (it is printed as Python does)
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code & 0xFF)


def _set_up(environment: Mapping[str, str], folder: str, output: int) -> None:
    """Session, signals, descriptors, variables and folder as those of a started program."""
    os.setsid()
    signal.set_wakeup_fd(-1)
    for caught in (signal.SIGCHLD, signal.SIGTERM):
        signal.signal(caught, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    no_input = os.open(os.devnull, os.O_RDONLY)
    for number, target in enumerate((no_input, output, output)):
        os.dup2(target, number)
    os.closerange(3, _DESCRIPTORS)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115


def _exit_code(end: SystemExit) -> int:
    if end.code is None:
        return 0
    if isinstance(end.code, int):
        return end.code
    print(end.code, file=sys.stderr)
    return 1


GRACE_S = 3.0
_POLL_S = 0.05
_KILL_TRIES, _KILL_S = 100, 0.01


Child = subprocess.Popen[bytes] | ForkedModule | ConfinedProcess


@dataclass(frozen=True)
class ChildExit:
    """How a child ended: ``code`` below 0 for a signal; ``used`` bytes of memory where that was more than allowed.

    ``failed`` means that it never began, because its sandbox could not be set up.
    """

    code: int
    used: int = 0
    failed: bool = False


class Children:
    """Children of this process by name; ``on_exit`` is called with the name of each that ended, and how."""

    def __init__(self, on_exit: Callable[[str, ChildExit], None], umask: int = -1) -> None:
        """``umask`` is that of programs that are started, by default this process's."""
        self._on_exit = on_exit
        self._umask = umask
        self._running: dict[str, Child] = {}
        self._used: dict[str, int] = {}
        self.limits: dict[str, int] = {}
        """Bytes of memory that the application's programs may use."""
        self.names: dict[int, str] = {}
        """All that were ever started, by process id."""

    def fork(self, name: str, words: Sequence[str], environment: dict[str, str], folder: str, output: int) -> int:
        """Forks this process for a Python module, and gives the process id; raises OSError."""
        return self._add(name, ForkedModule(words, environment, folder, output))

    def start(
        self,
        name: str,
        words: Sequence[str],
        environment: dict[str, str],
        folder: str,
        output: int,
        masked: Sequence[str] = (),
    ) -> int:
        """Starts a program that does not see ``masked`` devices, and gives its process id.

        Raises OSError, SubprocessError and ValueError.
        """
        child = subprocess.Popen(
            words,
            env=environment,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            umask=self._umask,
            preexec_fn=functools.partial(_begin, os.getpid(), masked),  # noqa: PLW1509  (it has one thread)
        )
        return self._add(name, child)

    def confine(
        self,
        name: str,
        words: Sequence[str],
        environment: dict[str, str],
        output: int,
        confined: Confinement,
        places: Places | None,
    ) -> int:
        """Starts a program of the application; raises as ``start``, and NoSeccomp."""
        child = ConfinedProcess(words, environment, output, confined, places, self._umask)
        self.limits[name] = confined.limits.memory
        return self._add(name, child)

    @property
    def are_watched(self) -> bool:
        """Whether any has a limit of memory."""
        return not self.limits.keys().isdisjoint(self._running)

    def watch_memory(self) -> None:
        """Ends those that use more memory than they may."""
        limits = {name: most for name, most in self.limits.items() if name in self._running and name not in self._used}
        for name, size in above(limits, self.names).items():
            self._used[name] = size
            os.kill(self._running[name].pid, signal.SIGKILL)

    def _add(self, name: str, child: Child) -> int:
        self._running[name] = child
        self.names[child.pid] = name
        return child.pid

    def reap(self) -> None:
        """Collects ended processes, adopted orphans among them."""
        by_pid = {child.pid: name for name, child in self._running.items()}
        with contextlib.suppress(ChildProcessError):
            while (info := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT | os.WNOHANG)) is not None:
                name = by_pid.get(info.si_pid)
                if name is None:
                    os.waitpid(info.si_pid, 0)
                else:
                    child = self._running.pop(name)
                    code = child.wait()
                    failed = isinstance(child, ConfinedProcess) and child.failed
                    self._on_exit(name, ChildExit(code, self._used.pop(name, 0), failed))

    def end_all(self, owns_namespace: bool, wait: Callable[[float], None]) -> None:
        """SIGTERM to the children, GRACE_S to comply, then SIGKILL to all descendants.

        With ``owns_namespace`` this process is process 1 of a namespace, and all others of it are its descendants.
        ``wait`` returns after some seconds, or sooner when a child has ended.
        """
        for child in reversed(self._running.values()):  # the application first: without a world it would fail
            for pid in _within(child.pid) if isinstance(child, ConfinedProcess) else (-child.pid,):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
        while self._running and time.monotonic() < deadline:
            wait(_POLL_S)
            self.reap()
        for _ in range(_KILL_TRIES):
            left = list(_descendants(owns_namespace))
            if not left:
                return
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(_KILL_S)
            self.reap()


def _begin(parent: int, masked: Sequence[str]) -> None:
    """Between fork and exec."""
    namespaces.mask(masked)
    namespaces.end_with(parent)


def _within(bubblewrap: int) -> Iterator[int]:
    """The processes in a sandbox, without bubblewrap's own two: its first process, and the one that it watches."""
    known = living()
    for pid in known:
        line = [pid]
        while line[-1] in known and line[-1] != bubblewrap:
            line.append(known[line[-1]].parent)
        if line[-1] == bubblewrap and len(line) > 2:
            yield pid


def _descendants(owns_namespace: bool) -> Iterator[int]:
    known = living()
    yield from (pid for pid in (known if owns_namespace else owners({os.getpid(): ""}, known)) if pid != os.getpid())
