"""The sandbox of one test: a small process that starts, watches and ends the test's processes.

It is process 1 of namespaces of its own (``network``), or their parent on the host (``host``). The runner talks to it
over a socket; when that closes, whatever closed it, the sandbox ends everything that it started, and itself. Should it
be killed, the kernel asks what it started to end. It has one thread: the kernel's promise is about that.

    runner to sandbox   {"do": "start", "id", "argv", "env", "cwd", "fork"} with the output's descriptor,
                        "env" being what differs from the sandbox's own (null removes), "fork" whether argv
                        is a Python module for which a fork of the sandbox will do; {"do": "close"};
                        {"do": "send", "cid", "data"}; {"do": "keep"} with the descriptors of outputs and logs
    sandbox to runner   {"up": pid} or {"down": why}; {"unstartable": id, "why"}; {"exited": id, "code"}
"""

import contextlib
import functools
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.forked_process import Forked

MAX_MESSAGE = 1 << 17
MAX_DESCRIPTORS = 250
GRACE_S = 3.0
_PORT = 12175


class Sandbox:
    """The loop of the sandbox's process."""

    def __init__(self, channel: socket.socket, isolation: str, forks: bool = False) -> None:
        """``forks`` says that this process has loaded what services need."""
        self.channel = channel
        self.isolation = isolation
        self.forks = forks
        self.children: dict[str, subprocess.Popen[bytes] | Forked] = {}
        self.keep = False
        self.ended = False
        self.pumps: dict[int, int] = {}
        self.wakeup, writer = os.pipe()
        os.set_blocking(self.wakeup, False)
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        for number in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _on_signal(self, number: int, _frame: object) -> None:
        if number == signal.SIGTERM:
            self.ended = True

    def tell(self, **message: object) -> None:
        with contextlib.suppress(OSError):
            self.channel.send(json.dumps(message).encode())

    def run(self) -> None:
        """Serves the runner until it closes the channel, then ends every process."""
        sources: list[socket.socket | int] = [self.channel, self.wakeup]
        while not self.ended:
            readable, _, _ = select.select([*sources, *self.pumps], [], [])
            if self.wakeup in readable:
                self._drain_wakeup()
            self._reap()
            for output in self.pumps.keys() & set(readable):
                self._pump(output)
            if self.channel in readable and not self._serve():
                if not self.keep:
                    break
                sources.remove(self.channel)
        self._end_all()

    def _drain_wakeup(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.read(self.wakeup, 4096)

    def _serve(self) -> bool:
        """Carries out one message; False when the runner has gone."""
        try:
            data, descriptors, _, _ = socket.recv_fds(self.channel, MAX_MESSAGE, MAX_DESCRIPTORS)
        except OSError:
            return False
        if not data:
            return False
        message = json.loads(data)
        try:
            getattr(self, f"_do_{message.pop('do')}")(descriptors, **message)
        finally:
            for descriptor in descriptors:
                os.close(descriptor)
        return True

    def _do_start(self, descriptors: list[int], **order: Any) -> None:
        name, output = order["id"], descriptors[0]
        environment = {k: v for k, v in {**os.environ, **order["env"]}.items() if v is not None}
        try:
            if self.forks and order["fork"]:
                self.children[name] = Forked(order["argv"], environment, order["cwd"], output)
                return
            self.children[name] = subprocess.Popen(
                order["argv"],
                env=environment,
                cwd=order["cwd"],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                preexec_fn=functools.partial(namespaces.end_with, os.getpid()),  # noqa: PLW1509  (it has one thread)
            )
        except (OSError, subprocess.SubprocessError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            self.tell(unstartable=name, why=f"{getattr(error, 'filename', None) or order['argv'][0]}: {why}")

    def _do_send(self, _descriptors: list[int], cid: int, data: str) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, contextlib.suppress(OSError):
            sender.sendto(bytes.fromhex(data), (f"225.0.0.{cid}", _PORT))

    def _do_keep(self, descriptors: list[int]) -> None:
        """Stays when the runner goes, and writes the services' output into their logs in its place."""
        self.keep = True
        copies = [os.dup(descriptor) for descriptor in descriptors]
        half = len(copies) // 2
        self.pumps = dict(zip(copies[:half], copies[half:], strict=True))

    def _pump(self, output: int) -> None:
        data = os.read(output, 1 << 16)
        if data:
            os.write(self.pumps[output], data)
        else:
            os.close(output)
            os.close(self.pumps.pop(output))

    def _do_close(self, _descriptors: list[int]) -> None:
        self.ended = True

    def _reap(self) -> None:
        """Collects ended processes: the test's own are told to the runner, adopted orphans only buried."""
        by_pid = {child.pid: name for name, child in self.children.items()}
        with contextlib.suppress(ChildProcessError):
            while (info := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT | os.WNOHANG)) is not None:
                name = by_pid.get(info.si_pid)
                if name is None:
                    os.waitpid(info.si_pid, 0)
                else:
                    self.tell(exited=name, code=self.children.pop(name).wait())

    def _end_all(self) -> None:
        """SIGTERM to the test's processes, a while to comply, then SIGKILL to all that is left."""
        for child in self.children.values():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
        while self.children and time.monotonic() < deadline:
            select.select([self.wakeup], [], [], 0.05)
            self._drain_wakeup()
            self._reap()
        for _ in range(100):
            left = list(self._left())
            if not left:
                return
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.01)
            self._reap()

    def _left(self) -> Iterator[int]:
        """Processes still there: all others of the namespace, or all descendants on the host."""
        parents = dict(_parents())
        if self.isolation == "network" and os.getpid() == 1:
            yield from (pid for pid in parents if pid != 1)
            return
        for pid in parents:
            ancestor = pid
            while ancestor in parents and ancestor != os.getpid():
                ancestor = parents[ancestor]
            if ancestor == os.getpid() and pid != ancestor:
                yield pid


def _parents() -> Iterator[tuple[int, int]]:
    """Every process that is no zombie, with its parent."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                if fields[0] != "Z":
                    yield int(entry.name), int(fields[1])


def _in_namespaces(channel: socket.socket) -> None:
    """Forks process 1 of new namespaces, which goes on; this process only waits for it."""
    namespaces.unshare()
    child = os.fork()
    if child == 0:
        namespaces.die_with_parent(signal.SIGKILL)
        namespaces.furnish()
        return
    channel.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    _, status = os.waitpid(child, 0)
    os._exit(os.waitstatus_to_exitcode(status) & 0xFF)


def main(argv: list[str]) -> int:
    """``sandbox DESCRIPTOR network|host [--forks]``: serves the runner at the other end of the descriptor."""
    channel = socket.socket(fileno=int(argv[0]))
    isolation, outside, forks = argv[1], os.getpid(), "--forks" in argv
    try:
        if isolation == "network":
            _in_namespaces(channel)
        else:
            namespaces.adopt_orphans()
    except OSError as error:
        channel.send(json.dumps({"down": str(error.strerror or error)}).encode())
        return 1
    sandbox = Sandbox(channel, isolation, forks)
    sandbox.tell(up=outside)
    sandbox.run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
