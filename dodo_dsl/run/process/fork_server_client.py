"""The runner's end of the fork server, and of sandboxes that are its forks and not the runner's own children."""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterable, Sequence

from dodo_dsl.run.process.environment import own_environment
from dodo_dsl.run.process.slot import package_path

END_S = 10.0


class ForkServer:
    """The runner's end of the fork server, which ends when this is closed, or with the runner.

    It loads for a second before it serves; what is asked of it meanwhile waits.
    """

    def __init__(self, descriptors: tuple[int, ...] = ()) -> None:
        """``descriptors`` are those of leases that sandboxes hold, too, as with ``hold``."""
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "dodo_dsl.run.process.fork_server", str(theirs.fileno())],
                pass_fds=(theirs.fileno(), *descriptors),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                env={**own_environment(), "PYTHONPATH": package_path()},
            )

    def hold(self, descriptor: int) -> None:
        """Lets the sandboxes to come hold a lease, too."""
        with contextlib.suppress(OSError):  # it has ended, which the next sandbox finds
            socket.send_fds(self._socket, [b'{"hold": true}'], [descriptor])

    def load(self, modules: Iterable[str]) -> None:
        """Lets the sandboxes to come have loaded these services of DoDo's."""
        with contextlib.suppress(OSError):  # it has ended, which the next sandbox finds
            self._socket.send(json.dumps({"load": sorted(modules)}).encode())

    def fork(self, channel: socket.socket, log: int, slot: str, words: Sequence[str] = ()) -> None:
        """Starts a sandbox at the other end of ``channel``, with more ``words``.

        Raises OSError when the fork server has ended.
        """
        socket.send_fds(self._socket, [json.dumps({"slot": slot, "words": words}).encode()], [channel.fileno(), log])

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def close(self) -> None:
        """Ends the fork server; the sandboxes stay."""
        self._socket.close()
        end(self._process)

    def kill(self) -> None:
        """Ends one that nothing was asked of, at once."""
        self._process.kill()
        self.close()


def serving(
    loaded: ForkServer | None, modules: Iterable[str] | None, descriptors: tuple[int, ...]
) -> ForkServer | None:
    """The one that loads these services: ``loaded``, or a new one; with no modules none, and ``loaded`` ends."""
    if modules is None:
        if loaded is not None:
            loaded.kill()
        return None
    server = loaded or ForkServer(descriptors)
    server.load(modules)
    return server


class ForkedSandbox:
    """A sandbox that is the fork server's child, with the interface of subprocess.Popen."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        try:
            self._descriptor = os.pidfd_open(pid)
        except ProcessLookupError:
            self._descriptor = -1

    def poll(self) -> int | None:
        """0 when it has ended, else None."""
        return 0 if self._descriptor < 0 or select.select([self._descriptor], [], [], 0)[0] else None

    def wait(self, timeout: float | None = None) -> int:
        """Waits until it has ended; raises TimeoutExpired."""
        if self._descriptor >= 0:
            if not select.select([self._descriptor], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("sandbox", timeout or 0.0)
            os.close(self._descriptor)
            self._descriptor = -1
        return 0

    def kill(self) -> None:
        """Ends it at once."""
        if self._descriptor >= 0:
            signal.pidfd_send_signal(self._descriptor, signal.SIGKILL)


def end(process: "subprocess.Popen[bytes] | ForkedSandbox") -> None:
    """Waits for a process that is about to end, and kills it where it does not."""
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
