"""The processes of a sandbox: forked, started or confined, collected when they end, and ended with all descendants."""

import contextlib
import functools
import os
import runpy
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

from dodo_dsl.run.machine_load.processes import above, living, owners
from dodo_dsl.run.machine_load.service_use import Snapshot
from dodo_dsl.run.process import confined_process, namespaces
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.process_group import ProcessGroup

GRACE_S = 3.0
_POLL_S = 0.05
_KILL_TRIES, _KILL_S = 100, 0.01
_DESCRIPTORS = 65_536


def _become(command: Command, output: int) -> NoReturn:
    """What a fork does whose command is ``python -m MODULE`` with arguments."""
    code = 1
    try:
        _set_up(command, output)
        sys.argv[:] = command.argv[2:]
        runpy.run_module(command.argv[2], run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        if code and not isinstance(end.code, int):
            print(end.code, file=sys.stderr)
    except BaseException:  # noqa: BLE001  (it is printed as Python does)
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code & 0xFF)


def _set_up(command: Command, output: int) -> None:
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
    os.environ.update(command.environment)
    os.chdir(command.folder)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115


@dataclass
class _Child:
    name: str
    process: subprocess.Popen[bytes] | None = None
    memory: int = 0
    """Bytes that an application's program may use at most; 0 of DoDo's, which no sandbox confines."""
    status: int = -1
    """What bubblewrap says of it."""
    group: ProcessGroup | None = None
    used: int = 0
    """Bytes for which it was ended."""


class Children:
    """Children of this process, which has one thread; ``on_exit`` is called for each that ended.

    It gets the name, the exit code, below 0 for a signal, the bytes of memory where those were more than allowed, and
    whether it never began, because its sandbox could not be set up.
    """

    def __init__(self, on_exit: Callable[[str, int, int, bool], None], umask: int) -> None:
        """``umask`` is that of programs that are started, -1 for this process's."""
        self._on_exit = on_exit
        self._umask = umask
        self._running: dict[int, _Child] = {}
        self.names: dict[int, str] = {}
        """All that were ever started, by process id."""
        self.application: dict[int, str] = {}
        """The application's among them."""
        self._took_s: dict[str, float] = {}
        """Processor time of the application's programs that ended, by their groups."""

    def start(self, command: Command, output: int, places: Places | None, may_fork: bool) -> None:
        """Starts a process; a module of DoDo's is forked where it ``may_fork``.

        Raises OSError, SubprocessError and ValueError.
        """
        child = _Child(command.name)
        if command.confined:
            child.memory = command.confined.limits.memory
            started = confined_process.start(command, command.confined, output, places, self._umask)
            child.process, child.status, child.group = started
            pid = child.process.pid
            self.application[pid] = command.name
        elif may_fork and command.is_module and not command.masked:
            Path(command.folder).stat()
            sys.stderr.flush()
            if (pid := os.fork()) == 0:
                _become(command, output)
        else:
            child.process = subprocess.Popen(
                command.argv,
                env=command.environment,
                cwd=command.folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                umask=self._umask,
                preexec_fn=functools.partial(namespaces.begin, os.getpid(), command.masked),  # noqa: PLW1509
            )
            pid = child.process.pid
        self._running[pid] = child
        self.names[pid] = child.name

    def with_counted(self, taken: Snapshot) -> Snapshot:
        """What services used, with processes that ended before they were seen, where control groups count them."""
        took_s = self._took_s | {child.name: child.group.used_s() for child in self._running.values() if child.group}
        services = {
            name: used._replace(processor_s=max(used.processor_s, took_s.get(name, 0.0)))
            for name, used in taken.services.items()
        }
        return replace(taken, services=services)

    def watch_memory(self) -> None:
        limits = {child.name: child.memory for child in self._running.values() if child.memory and not child.used}
        found = above(limits, self.names) if limits else {}
        for pid, child in self._running.items():
            if child.name in found:
                child.used = found[child.name]
                os.kill(pid, signal.SIGKILL)

    def reap(self) -> None:
        """Collects ended processes, adopted orphans among them."""
        with contextlib.suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                if child := self._running.pop(ended[0], None):
                    code, failed = os.waitstatus_to_exitcode(ended[1]), False
                    if child.process:
                        child.process.returncode = code  # so that nobody waits for it again
                    if child.group:
                        self._took_s[child.name] = child.group.used_s()
                        child.group.remove()
                    if child.status >= 0:
                        code, failed = confined_process.ended(child.status, code)
                    self._on_exit(child.name, code, child.used, failed)

    def end_all(self, owns_namespace: bool, wait: Callable[[float], None]) -> None:
        """SIGTERM to the children, GRACE_S to comply, then SIGKILL to all descendants.

        With ``owns_namespace`` this process is process 1 of a namespace, and all others of it are its descendants.
        ``wait`` returns after some seconds, or sooner when a child has ended.
        """
        for child in reversed(self._running):  # the application first: without a world it would fail
            _signal(_within(child) if child in self.application else [-child], signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
        while self._running and time.monotonic() < deadline:
            wait(_POLL_S)
            self.reap()
        for _ in range(_KILL_TRIES):
            known = living()
            if not (left := (known if owns_namespace else owners({os.getpid(): ""}, known)).keys() - {os.getpid()}):
                return
            _signal(left, signal.SIGKILL)
            time.sleep(_KILL_S)
            self.reap()


def _signal(pids: Iterable[int], number: signal.Signals) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def _within(bubblewrap: int) -> list[int]:
    """The processes in a sandbox, without bubblewrap's own two: its first process, and the one that it watches."""
    known = living()
    return [pid for pid in owners({bubblewrap: "-"}, known) if bubblewrap not in (pid, known[pid].parent)]
