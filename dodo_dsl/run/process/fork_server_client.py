"""The runner's end of the fork server."""

import contextlib
import json
import socket
import subprocess
import sys
from collections.abc import Iterable

from dodo_dsl.run.process.environment import own_environment
from dodo_dsl.run.process.slot import package_path

END_S = 10.0
"""How long what is about to end is waited for."""


class ForkServer:
    """The runner's end of the fork server, which ends when this is closed, or with the runner.

    It loads for a second before it serves; what is asked of it meanwhile waits.
    """

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "dodo_dsl.run.process.fork_server", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
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

    def fork(self, channel: socket.socket, log: int, slot: str, entered: str) -> None:
        """Starts a sandbox at the other end of ``channel``, in its namespaces.

        Raises OSError when the fork server has ended.
        """
        socket.send_fds(
            self._socket, [json.dumps({"slot": slot, "entered": entered}).encode()], [channel.fileno(), log]
        )

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def close(self) -> None:
        """Ends the fork server; the sandboxes stay."""
        self._socket.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def kill(self) -> None:
        """Ends one that nothing was asked of, at once."""
        self._process.kill()
        self.close()


def serving(
    loaded: ForkServer | None, modules: Iterable[str] | None, descriptors: tuple[int, ...]
) -> ForkServer | None:
    """The one that loads these services: ``loaded``, or a new one; with no modules none, and ``loaded`` ends.

    Its sandboxes hold the leases of the ``descriptors``, too.
    """
    if modules is None:
        if loaded is not None:
            loaded.kill()
        return None
    server = loaded or ForkServer()
    for descriptor in descriptors:
        server.hold(descriptor)
    server.load(modules)
    return server
