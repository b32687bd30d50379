"""Whole messages, in order, over Unix sockets in the folder of DoDo's own where the services of a test meet.

The application does not have that folder.
"""

import contextlib
import os
import select
import socket
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Self

CLOCK_SOCKET, RUNNER_SOCKET = ".clock", ".runner"
PACKET = 1 << 16
_LAST, _MORE = b"\0", b"\1"
_MOST_PARTS = 1024
_AGAIN_S, _NAME_S = 0.005, 1.0


@contextlib.contextmanager
def _short(path: Path) -> Iterator[str]:
    """The path of a socket in a form that an address can hold, however long the folder's is."""
    folder = os.open(path.parent, os.O_PATH)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


class Connection:
    """One end of a connection. A message longer than a packet takes several, of which the first byte says so."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)
        self._parts: list[bytes] = []

    @classmethod
    def open(cls, path: Path, name: str, patience: float = 0.0) -> Self:
        """Connects as a service of this name; raises OSError where nobody listens within ``patience`` seconds."""
        end = time.monotonic() + patience
        while True:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                with _short(path) as address:
                    connection.connect(address)
            except OSError as error:
                connection.close()
                if not isinstance(error, FileNotFoundError | ConnectionRefusedError) or time.monotonic() >= end:
                    raise
                time.sleep(_AGAIN_S)
            else:
                made = cls(connection)
                made.send(name.encode())
                return made

    def send(self, data: bytes) -> bool:
        """Sends a message; whether the other end is there to take it."""
        try:
            while len(data) > PACKET:
                self._socket.send(_MORE + data[:PACKET])
                data = data[PACKET:]
            self._socket.send(_LAST + data)
        except OSError:
            return False
        return True

    def receive(self, timeout: float) -> bytes | None:
        """The next message, if each part of it comes within ``timeout`` seconds of the one before.

        Raises EOFError when the other end has gone, and has left nothing to read.
        """
        while self._poll.poll(timeout * 1000):
            try:
                packet = self._socket.recv(PACKET + 1)
            except ConnectionError:  # of what it was sent and has not read; what it said may still be there
                continue
            if not packet or len(self._parts) > _MOST_PARTS:
                raise EOFError
            self._parts.append(packet[1:])
            if packet[:1] == _LAST:
                data = b"".join(self._parts)
                self._parts.clear()
                return data
        return None

    @property
    def has_gone(self) -> bool:
        return any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


class Listener:
    """The end to which services connect, each of ``services`` once; others are turned away."""

    def __init__(self, path: Path, services: Iterable[str]) -> None:
        self._path = path
        self.missing = set(services)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        path.unlink(missing_ok=True)
        with _short(path) as address:
            self._socket.bind(address)
        path.chmod(0o666)
        self._socket.listen(socket.SOMAXCONN)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def accept(self, timeout: float) -> tuple[str, Connection] | None:
        """A service that connects within ``timeout`` seconds, with its name; nobody can behind the last one."""
        connection = self.connection(timeout)
        if connection is None:
            return None
        try:
            name = (connection.receive(_NAME_S) or b"").decode("utf-8", "replace")
        except EOFError:
            name = ""
        if name not in self.missing or connection.has_gone:
            connection.close()
            return None
        self.named(name)
        return name, connection

    def connection(self, timeout: float = 0.0) -> Connection | None:
        """One that has been made, whose first message, the name, may not have come."""
        is_there = self.missing and self._poll.poll(timeout * 1000)
        return Connection(self._socket.accept()[0]) if is_there else None

    def named(self, name: str) -> None:
        self.missing.discard(name)
        if not self.missing:
            self.close()

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self.missing.clear()
        self._socket.close()
        self._path.unlink(missing_ok=True)
