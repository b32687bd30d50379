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
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import msgspec

from dodo_dsl.opendlv.relay import Relay
from dodo_dsl.run.listeners import listening
from dodo_dsl.run.machine_load.service_use import UseReader
from dodo_dsl.run.process import namespaces, places
from dodo_dsl.run.process.children import Children
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.places import Places
from dodo_dsl.run.process.slot import Entered

PERIOD_S = 0.25
"""Between two looks at the memory of the application's programs."""
MAX_MESSAGE = 1 << 17
MAX_DESCRIPTORS = 2
UMASK = 0o022
"""Of programs in own namespaces, as in containers: what one user's service makes, another's is to read."""


class Sandbox:
    def __init__(self, channel: socket.socket, is_on_host: bool) -> None:
        self.channel = channel
        self.is_on_host = is_on_host
        self.use = UseReader()
        self.children = Children(self._exited, -1 if is_on_host else UMASK)
        self.places: Places | None = None
        self.relay: Relay | None = None
        self.keep = False
        self.ended = False
        self.wakeup, writer = os.pipe2(os.O_NONBLOCK)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        for number in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _on_signal(self, number: int, _frame: object) -> None:
        if number == signal.SIGTERM:
            self.ended = True

    def _exited(self, name: str, code: int, used: int, failed: bool) -> None:
        self.send(exited=name, code=code, used=used, failed=failed)

    def send(self, **message: object) -> None:
        with contextlib.suppress(OSError):
            self.channel.send(json.dumps(message).encode())

    def run(self) -> None:
        """Serves the runner until it closes the channel, then ends every process."""
        sources: list[socket.socket | int] = [self.channel, self.wakeup]
        watched_s = 0.0
        while not self.ended:
            readable, _, _ = select.select(sources, [], [], PERIOD_S if self.children.application else None)
            if time.monotonic() >= watched_s + PERIOD_S:
                self.children.watch_memory()
                watched_s = time.monotonic()
            if self.wakeup in readable:
                self._drain_wakeup()
            self.children.reap()
            if self.channel in readable and not self._serve():
                if not self.keep:
                    break
                sources.remove(self.channel)
        self.children.end_all(not self.is_on_host, self._wait)

    def _drain_wakeup(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self.wakeup, 4096)

    def _wait(self, seconds: float) -> None:
        """Returns at the next signal, at the latest after ``seconds``."""
        select.select([self.wakeup], [], [], seconds)
        self._drain_wakeup()

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
            if command.confined and self.places is None and not self.is_on_host:
                self.places = Places(command.confined.folder, places.own_user())
            self.children.start(command, output, self.places, may_fork=not self.is_on_host)
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
        self.send(use=asdict(self.children.with_counted(self.use.take({**self.children.names, os.getpid(): ""}))))

    def _do_listeners(self, _descriptors: list[int]) -> None:
        found = listening(self.children.application)
        self.send(listeners=None if found is None else sorted(found))

    def _do_keep(self, _descriptors: list[int]) -> None:
        self.keep = True

    def _do_close(self, _descriptors: list[int]) -> None:
        self.ended = True


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
