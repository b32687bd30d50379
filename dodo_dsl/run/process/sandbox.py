"""The sandbox of one test: a small process that starts, watches and ends the test's processes.

It is process 1 of its own namespaces (``network``), or their parent on the host (``host``). The runner talks to it
over a socket; when that closes, for whatever reason, the sandbox ends everything that it started, and itself. If it is
killed, the kernel sends SIGTERM to what it started. It has one thread: that signal depends on the starting thread.

    runner to sandbox   {"do": "start"} with the output's descriptor, and that of a file with a ``Command``;
                        {"do": "close"}; {"do": "listeners"};
                        {"do": "relay", "cid", "folder"}; {"do": "send", "to": [name, ...], "data"};
                        {"do": "use", "names": services of which memory is measured, too};
                        {"do": "keep"}: stay when the runner ends
    sandbox to runner   {"up": pid} or {"down": why}; {"started": id} or
                        {"unstartable": id, "why"}; {"exited": id, "code", "used", "failed"};
                        {"relay": whether it can send};
                        {"listeners": names of what listens on a bus, or null};
                        {"use": snapshot}
"""

import contextlib
import functools
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NoReturn

import msgspec

from dodo_dsl.opendlv.relay import Relay
from dodo_dsl.run.listeners import listening
from dodo_dsl.run.machine_load.processes import above, living, owners
from dodo_dsl.run.machine_load.service_use import Snapshot, UseReader
from dodo_dsl.run.process import confined_process, namespaces, places
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.process_group import ProcessGroup
from dodo_dsl.run.process.slot import Entered

PERIOD_S = 0.25
"""Between two looks at the memory of the application's programs."""
MAX_MESSAGE = 1 << 17
MAX_DESCRIPTORS = 2
GRACE_S = 3.0
_POLL_S = 0.05
_KILL_TRIES, _KILL_S = 100, 0.01
_DESCRIPTORS = 65_536
UMASK = 0o022
"""Of programs in own namespaces, as in containers: what one user's service makes, another's is to read."""


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


class Sandbox:
    def __init__(self, channel: socket.socket, is_on_host: bool) -> None:
        self.channel = channel
        self.is_on_host = is_on_host
        self.use = UseReader()
        self.running: dict[int, _Child] = {}
        self.names: dict[int, str] = {}
        """All that were ever started, by process id."""
        self.application: dict[int, str] = {}
        """The application's among them."""
        self.took_s: dict[str, float] = {}
        """Processor time of the application's programs that ended, by their groups."""
        self.places: Places | None = None
        self.relay: Relay | None = None
        self.keep = False
        self.ended = False
        self.wakeup, writer = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        for number in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _on_signal(self, number: int, _frame: object) -> None:
        if number == signal.SIGTERM:
            self.ended = True

    def send(self, **message: object) -> None:
        with contextlib.suppress(OSError):
            self.channel.send(json.dumps(message).encode())

    def run(self) -> None:
        """Serves the runner until it closes the channel, then ends every process."""
        sources: list[socket.socket | int] = [self.channel, self.wakeup]
        watched_s = 0.0
        while not self.ended:
            readable, _, _ = select.select(sources, [], [], PERIOD_S if self.application else None)
            if time.monotonic() >= watched_s + PERIOD_S:
                self.watch_memory()
                watched_s = time.monotonic()
            if self.wakeup in readable:
                self._drain_wakeup()
            self.reap()
            if self.channel in readable and not self._serve():
                if not self.keep:
                    break
                sources.remove(self.channel)
        self.end_all()

    def _drain_wakeup(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self.wakeup, 4096)

    def _serve(self) -> bool:
        """Carries out one message; False when the runner has closed the channel."""
        data = b""
        with contextlib.suppress(OSError):
            data, descriptors, _, _ = socket.recv_fds(self.channel, MAX_MESSAGE, MAX_DESCRIPTORS)
        if not data:
            return False
        message = json.loads(data)
        try:
            getattr(self, f"_do_{message.pop('do')}")(descriptors, **message)
        finally:
            for descriptor in descriptors:
                os.close(descriptor)
        return True

    def _do_start(self, descriptors: list[int]) -> None:
        output, file = descriptors
        command = msgspec.convert(json.loads(os.pread(file, os.fstat(file).st_size, 0)), Command)
        try:
            self.start(command, output)
            self.send(started=command.name)
        except (OSError, subprocess.SubprocessError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            self.send(unstartable=command.name, why=f"{getattr(error, 'filename', None) or command.argv[0]}: {why}")

    def _do_relay(self, _descriptors: list[int], cid: int, folder: str) -> None:
        with contextlib.suppress(OSError):
            self.relay = Relay(cid, Path(folder))
        self.send(relay=self.relay is not None)

    def _do_send(self, _descriptors: list[int], to: list[str], data: str) -> None:
        if self.relay is not None:
            self.relay.send(bytes.fromhex(data), to)

    def _do_use(self, _descriptors: list[int], names: list[str]) -> None:
        self.use.sized.update(names)
        self.send(use=asdict(self.with_counted(self.use.take({**self.names, os.getpid(): ""}))))

    def _do_listeners(self, _descriptors: list[int]) -> None:
        found = listening(self.application)
        self.send(listeners=None if found is None else sorted(found))

    def _do_keep(self, _descriptors: list[int]) -> None:
        self.keep = True

    def _do_close(self, _descriptors: list[int]) -> None:
        self.ended = True

    def start(self, command: Command, output: int) -> None:
        """Starts a process; raises OSError, SubprocessError and ValueError."""
        child, umask = _Child(command.name), -1 if self.is_on_host else UMASK
        if command.confined:
            if self.places is None and not self.is_on_host:
                self.places = Places(command.confined.folder, places.own_user())
            child.memory = command.confined.limits.memory
            started = confined_process.start(command, command.confined, output, self.places, umask)
            child.process, child.status, child.group = started
            pid = child.process.pid
            self.application[pid] = command.name
        elif command.is_module and not self.is_on_host:
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
                umask=umask,
                preexec_fn=functools.partial(namespaces.begin, os.getpid(), command.masked),  # noqa: PLW1509
            )
            pid = child.process.pid
        self.running[pid] = child
        self.names[pid] = child.name

    def with_counted(self, taken: Snapshot) -> Snapshot:
        """What services used, with processes that ended before they were seen, where control groups count them."""
        took_s = self.took_s | {child.name: child.group.used_s() for child in self.running.values() if child.group}
        services = {
            name: used._replace(processor_s=max(used.processor_s, took_s.get(name, 0.0)))
            for name, used in taken.services.items()
        }
        return replace(taken, services=services)

    def watch_memory(self) -> None:
        limits = {child.name: child.memory for child in self.running.values() if child.memory and not child.used}
        found = above(limits, self.names) if limits else {}
        for pid, child in self.running.items():
            if child.name in found:
                child.used = found[child.name]
                os.kill(pid, signal.SIGKILL)

    def reap(self) -> None:
        """Collects ended processes, adopted orphans among them."""
        with contextlib.suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                if child := self.running.pop(ended[0], None):
                    code, failed = os.waitstatus_to_exitcode(ended[1]), False
                    if child.process:
                        child.process.returncode = code  # so that nobody waits for it again
                    if child.group:
                        self.took_s[child.name] = child.group.used_s()
                        child.group.remove()
                    if child.status >= 0:
                        code, failed = confined_process.ended(child.status, code)
                    self.send(exited=child.name, code=code, used=child.used, failed=failed)

    def end_all(self) -> None:
        """SIGTERM to the children, GRACE_S to comply, then SIGKILL to all descendants: all others of a namespace."""
        for child in reversed(self.running):  # the application first: without a world it would fail
            _signal(_within(child) if child in self.application else [-child], signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
        while self.running and time.monotonic() < deadline:
            select.select([self.wakeup], [], [], _POLL_S)
            self._drain_wakeup()
            self.reap()
        for _ in range(_KILL_TRIES):
            known = living()
            if not (left := (owners({os.getpid(): ""}, known) if self.is_on_host else known).keys() - {os.getpid()}):
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


def _in_namespaces(channel: socket.socket, entered: Entered) -> None:
    """Forks process 1 of new namespaces, which returns; this process only waits for it."""
    trees = namespaces.enter(entered.process) if entered.process else {}
    if not entered.process:
        namespaces.unshare()
    child = os.fork()
    if child == 0:
        namespaces.die_with_parent(signal.SIGKILL)
        namespaces.furnish(entered.shown, trees)
        return
    channel.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    _, status = os.waitpid(child, 0)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


def serve(channel: socket.socket, entered: Entered | None) -> int:
    """Serves the runner at the other end; ``entered`` is None on the host. The exit code of this process."""
    outside = os.getpid()
    try:
        if entered:
            _in_namespaces(channel, entered)
        else:
            namespaces.adopt_orphans()
    except OSError as error:
        channel.send(json.dumps({"down": str(error.strerror or error)}).encode())
        return 1
    sandbox = Sandbox(channel, entered is None)
    sandbox.send(up=outside)
    sandbox.run()
    return 0


if __name__ == "__main__":
    sys.exit(serve(socket.socket(fileno=int(sys.argv[1])), None))
