"""The processes of a sandbox: started or forked, collected when they end, and ended with all their descendants."""

import contextlib
import functools
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.forked_process import ForkedModule

GRACE_S = 3.0
_POLL_S = 0.05
_KILL_TRIES, _KILL_S = 100, 0.01


class Children:
    """Children of this process by name; ``on_exit`` is called with the name and exit code of each that ended."""

    def __init__(self, on_exit: Callable[[str, int], None]) -> None:
        self._on_exit = on_exit
        self._running: dict[str, subprocess.Popen[bytes] | ForkedModule] = {}
        self.names: dict[int, str] = {}
        """All that were ever started, by process id."""

    def fork(self, name: str, words: Sequence[str], environment: dict[str, str], folder: str, output: int) -> int:
        """Forks this process for a Python module, and gives the process id; raises OSError."""
        return self._add(name, ForkedModule(words, environment, folder, output))

    def start(self, name: str, words: Sequence[str], environment: dict[str, str], folder: str, output: int) -> int:
        """Starts a program, and gives its process id; raises OSError, SubprocessError and ValueError."""
        child = subprocess.Popen(
            words,
            env=environment,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            preexec_fn=functools.partial(namespaces.end_with, os.getpid()),  # noqa: PLW1509  (it has one thread)
        )
        return self._add(name, child)

    def _add(self, name: str, child: "subprocess.Popen[bytes] | ForkedModule") -> int:
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
                    self._on_exit(name, self._running.pop(name).wait())

    def end_all(self, owns_namespace: bool, wait: Callable[[float], None]) -> None:
        """SIGTERM to the children, GRACE_S to comply, then SIGKILL to all descendants.

        With ``owns_namespace`` this process is process 1 of a namespace, and all others of it are its descendants.
        ``wait`` returns after some seconds, or sooner when a child has ended.
        """
        for child in self._running.values():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGTERM)
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


def _descendants(owns_namespace: bool) -> Iterator[int]:
    parents = dict(_parents())
    if owns_namespace:
        yield from (pid for pid in parents if pid != os.getpid())
        return
    for pid in parents:
        ancestor = pid
        while ancestor in parents and ancestor != os.getpid():
            ancestor = parents[ancestor]
        if ancestor == os.getpid() and pid != ancestor:
            yield pid


def _parents() -> Iterator[tuple[int, int]]:
    """The pids of every process that is not a zombie and of its parent."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if fields[0] != "Z":
                    yield int(entry.name), int(fields[1])
