"""The runner's end of a test's sandbox, with messages as ``sandbox`` documents them."""

import asyncio
import contextlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any

from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.environment import own_environment
from dodo_dsl.run.process.fork_server import ForkServer
from dodo_dsl.run.process.sandbox import MAX_MESSAGE
from dodo_dsl.run.process.slot import SLOT_VARIABLE, Entered, Slot, package_path
from dodo_dsl.run.protocol import BackendError

SEND_S = 10
END_S = 10.0
"""How long a sandbox that is about to end is waited for."""


class SandboxClient:
    """One sandbox; ``on_message`` gets its messages, ``on_lost`` the reason when it is out of reach."""

    def __init__(self, on_message: Callable[[dict[str, Any]], None], on_lost: Callable[[str], None]) -> None:
        self._on_message = on_message
        self._on_lost = on_lost
        self.pid: int | None = None
        """The sandbox's process while it runs."""
        self._child: subprocess.Popen[bytes] | None = None
        self._end = -1
        self._socket: socket.socket | None = None
        self._closing = False

    async def open(
        self, slot: Slot, log: int, server: ForkServer | None, entered: Entered, modules: Iterable[str] = ()
    ) -> None:
        """Starts the sandbox, which logs to a descriptor and holds the slot's leases; raises BackendError.

        It is forked by a ``server`` that has loaded modules, and has ``entered`` its namespaces; on the host there is
        none.
        """
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", SEND_S, 0))  # it may be busy
        self._socket = ours
        with theirs:
            if server is not None:
                server.fork(entered, modules, [theirs.fileno(), log, *slot.descriptors])
            else:
                self._child = subprocess.Popen(
                    [sys.executable, "-P", "-m", "dodo_dsl.run.process.sandbox", str(theirs.fileno())],
                    pass_fds=(theirs.fileno(), *slot.descriptors),
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    start_new_session=True,
                    env={**own_environment(), "PYTHONPATH": package_path(), SLOT_VARIABLE: slot.name},
                )
        loop = asyncio.get_running_loop()
        ours.setblocking(False)
        said = await loop.sock_recv(ours, MAX_MESSAGE)
        ours.setblocking(True)
        answer: dict[str, Any] = json.loads(said) if said else {"down": "it ended at once"}
        if "up" not in answer:
            raise BackendError(f"the test's sandbox does not start: {answer['down']}")
        loop.add_reader(ours, self._receive)
        self.pid = answer["up"]
        with contextlib.suppress(ProcessLookupError):
            self._end = os.pidfd_open(answer["up"])

    def _receive(self) -> None:
        assert self._socket is not None
        try:
            data = self._socket.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._on_message(json.loads(data))
            return
        asyncio.get_running_loop().remove_reader(self._socket)
        self.pid = None
        if not self._closing:
            self._on_lost("the test's sandbox ended unexpectedly")

    def start(self, command: Command, output: int) -> None:
        """Starts a process with an output, by a file, as words and variables may be longer than a message."""
        with os.fdopen(os.memfd_create("command"), "wb") as file:
            file.write(json.dumps(asdict(command)).encode())
            file.flush()
            self.send({"do": "start"}, (output, file.fileno()))

    def send(self, message: dict[str, Any], descriptors: tuple[int, ...] = ()) -> None:
        assert self._socket is not None
        try:
            socket.send_fds(self._socket, [json.dumps(message).encode()], list(descriptors))
        except OSError as error:
            why = f"it has read nothing for {SEND_S} s" if isinstance(error, BlockingIOError) else error.strerror
            self._on_lost(f"the test's sandbox cannot be reached: {why}")

    async def close(self) -> None:
        """Ends everything in the sandbox, and itself."""
        self._closing = True
        if self._socket is None:
            return
        if self._end >= 0:
            self.send({"do": "close"})
            await asyncio.to_thread(self._wait)
            with contextlib.suppress(OSError):
                while data := self._socket.recv(MAX_MESSAGE, socket.MSG_DONTWAIT):  # how the last of them ended
                    self._on_message(json.loads(data))
        asyncio.get_running_loop().remove_reader(self._socket)
        self._socket.close()

    def _wait(self) -> None:
        """Returns when the sandbox has ended, which is killed where it does not end by itself."""
        if not select.select([self._end], [], [], END_S)[0]:
            signal.pidfd_send_signal(self._end, signal.SIGKILL)
            select.select([self._end], [], [])
        os.close(self._end)
        self._end = -1
        if self._child is not None:
            self._child.wait()

    def keep(self) -> None:
        """Lets the sandbox outlive the runner."""
        self._closing = True
        self.send({"do": "keep"})
