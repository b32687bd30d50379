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

from dodo_dsl.run.machine_load.processes import owners, parents
from dodo_dsl.run.process import confined_process, namespaces
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
    """Children of this process by name; ``on_exit`` is called with the name of each that ended, and how.

    Before, while the kernel still knows it, ``on_end`` is called with its process id and name.
    """

    def __init__(
        self,
        on_exit: Callable[[str, ChildExit], None],
        on_end: Callable[[int, str], None] = lambda _pid, _name: None,
        umask: int = -1,
    ) -> None:
        """``umask`` is that of programs that are started, by default this process's."""
        self._on_exit = on_exit
        self._on_end = on_end
        self._umask = umask
        self._running: dict[str, Child] = {}
        self._used: dict[str, int] = {}
        self._took_s: dict[str, float | None] = {}
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
        return self._add(name, ConfinedProcess(words, environment, output, confined, places, self._umask))

    def took_s(self) -> dict[str, float | None]:
        """Processor time in s of each of the application's programs, also of all that ended; None where not counted."""
        confined = {n: c.used_s() for n, c in self._running.items() if isinstance(c, ConfinedProcess)}
        return {**self._took_s, **confined}

    @property
    def are_watched(self) -> bool:
        """Whether any has a limit of memory."""
        return any(isinstance(child, ConfinedProcess) for child in self._running.values())

    def watch_memory(self) -> None:
        """Ends those that use more memory than they may."""
        confined = {c.pid: (name, c.memory) for name, c in self._running.items() if isinstance(c, ConfinedProcess)}
        limits = {pid: most for pid, (_, most) in confined.items()}
        for pid, size in confined_process.above(limits, dict(parents())).items():
            name, _ = confined[pid]
            if name not in self._used:
                self._used[name] = size
                os.kill(pid, signal.SIGKILL)

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
                    self._on_end(child.pid, name)
                    if isinstance(child, ConfinedProcess):
                        self._took_s[name] = child.used_s()
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
    known = dict(parents())
    for pid in known:
        line = [pid]
        while line[-1] in known and line[-1] != bubblewrap:
            line.append(known[line[-1]])
        if line[-1] == bubblewrap and len(line) > 2:
            yield pid


def _descendants(owns_namespace: bool) -> Iterator[int]:
    if owns_namespace:
        yield from (pid for pid, _ in parents() if pid != os.getpid())
        return
    yield from (pid for pid, _ in owners({os.getpid(): ""}) if pid != os.getpid())
