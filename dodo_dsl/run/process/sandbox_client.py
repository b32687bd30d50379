"""The runner's end of a test's sandbox: starts it, and exchanges messages with it (``sandbox`` has their shapes)."""

import asyncio
import errno
import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dodo_dsl.run.process.commands import Lane, package_path
from dodo_dsl.run.process.fork_server_client import Fork, Nursery, end
from dodo_dsl.run.process.sandbox import MAX_MESSAGE
from dodo_dsl.run.protocol import BackendError

CLOSE_S = 10.0
LOG = "sandbox.log"


class Channel:
    """A sandbox of its own; ``heard`` is told its messages, ``lost`` why it cannot be talked to any more.

    It is a fork of the ``nursery``, or a process of its own where there is none.
    """

    def __init__(
        self,
        isolation: str,
        heard: Callable[[dict[str, Any]], None],
        lost: Callable[[str], None],
        nursery: Nursery | None = None,
    ) -> None:
        self._isolation = isolation
        self._nursery = nursery if isolation == "network" else None
        self._heard = heard
        self._lost = lost
        self._process: subprocess.Popen[bytes] | Fork | None = None
        self._socket: socket.socket | None = None
        self._up: asyncio.Future[dict[str, Any]] | None = None
        self._closing = False

    @property
    def pid(self) -> int | None:
        """The sandbox's process while it runs."""
        return self._process.pid if self._process is not None and self._process.poll() is None else None

    async def open(self, lane: Lane, folder: Path) -> None:
        """Starts the sandbox, which logs into ``folder`` and holds the lane's leases; raises BackendError."""
        folder.mkdir(parents=True, exist_ok=True)
        answer = await self._started(lane, folder / LOG)
        if "down" in answer and self._nursery is not None:  # which may have gone
            self._nursery = None
            self._close_socket()
            answer = await self._started(lane, folder / LOG)
        if "down" in answer:
            raise BackendError(f"no sandbox of isolation {self._isolation}: {answer['down']}")
        if self._process is None:
            self._process = Fork(answer["up"])

    async def _started(self, lane: Lane, log: Path) -> dict[str, Any]:
        """What the new sandbox says first."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        self._socket, self._up = ours, asyncio.get_running_loop().create_future()
        with theirs, log.open("wb") as stderr:
            if not self._is_forked(theirs, stderr.fileno(), lane):
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "dodo_dsl.run.process.sandbox", str(theirs.fileno()), self._isolation],
                    pass_fds=(theirs.fileno(), *lane.descriptors),
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=stderr,
                    start_new_session=True,
                    env={**os.environ, "PYTHONPATH": package_path(), "DODO_LANE": lane.name},
                )
        asyncio.get_running_loop().add_reader(ours, self._hear)
        return await self._up

    def _is_forked(self, theirs: socket.socket, log: int, lane: Lane) -> bool:
        """Whether the nursery makes the sandbox; one that has gone makes none."""
        if self._nursery is None:
            return False
        try:
            self._nursery.fork(theirs, log, lane.name)
        except OSError:
            self._nursery = None
            return False
        return True

    def _close_socket(self) -> None:
        if self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()

    def _hear(self) -> None:
        assert self._socket is not None
        try:
            data = self._socket.recv(MAX_MESSAGE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._take(json.loads(data))
            return
        asyncio.get_running_loop().remove_reader(self._socket)
        was_up = self._up is not None and self._up.done()
        self._resolve({"down": "it ended at once"})
        if was_up and not self._closing:
            self._lost("the test's sandbox ended unexpectedly")

    def _take(self, message: dict[str, Any]) -> None:
        if "up" in message or "down" in message:
            self._resolve(message)
        else:
            self._heard(message)

    def _resolve(self, answer: dict[str, Any]) -> None:
        if self._up is not None and not self._up.done():
            self._up.set_result(answer)

    def send(self, message: dict[str, Any], descriptors: tuple[int, ...] = ()) -> None:
        """A message and the descriptors that go with it; ValueError when it is more than the sandbox reads at once."""
        assert self._socket is not None
        data = json.dumps(message).encode()
        if len(data) > MAX_MESSAGE:
            raise ValueError(f"{len(data):,} bytes of words and variables, expected at most {MAX_MESSAGE:,}")
        try:
            send_patiently(self._socket, data, descriptors)
        except OSError as error:
            self._lost(f"the test's sandbox cannot be reached: {error.strerror}")

    async def close(self) -> None:
        """Ends everything in the sandbox, and itself."""
        self._closing = True
        if self._process is not None and self._socket is not None:
            self.send({"do": "close"})
            loop = asyncio.get_running_loop()
            await loop.run_in_executor(None, end, self._process)
            loop.remove_reader(self._socket)
        if self._socket is not None:
            self._socket.close()

    def keep(self, descriptors: tuple[int, ...]) -> None:
        """Leaves the sandbox to itself, with the descriptors of outputs, then of their logs."""
        self._closing = True
        self.send({"do": "keep"}, descriptors)


def send_patiently(channel: socket.socket, data: bytes, descriptors: tuple[int, ...]) -> None:
    """Sends one message; a sandbox that is busy starting processes is waited for, one that hangs is not."""
    deadline = time.monotonic() + CLOSE_S
    while True:
        try:
            socket.send_fds(channel, [data], list(descriptors))
        except BlockingIOError:
            left = deadline - time.monotonic()
            if left <= 0:
                raise OSError(errno.ETIMEDOUT, f"it has read nothing for {CLOSE_S:g} s") from None
            select.select([], [channel], [], left)
        else:
            return
