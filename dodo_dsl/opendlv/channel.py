"""What DoDo's services say to each other past the bus: typed messages over a Unix socket in a folder of DoDo's own.

The folder is in the sandbox of no application. In lockstep the clock listens there, and each service of the test
connects and gives its name before it is ready, so before the application starts.
"""

import contextlib
import os
import select
import socket
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Self

import msgspec
from msgspec import Struct

from dodo_dsl.opendlv.address import Address
from dodo_dsl.opendlv.envelope import Envelope

CLOCK_SOCKET = ".clock"


class Hello(Struct, tag=True, array_like=True):
    """The first message: which service of the test it is."""

    service: str


class Step(Struct, tag=True, array_like=True):
    """The clock lets a service go on to a time (us) with all that it has not heard yet; Done follows."""

    time: int
    messages: list[Envelope]


class Show(Struct, tag=True, array_like=True):
    """The service ``awaits`` readers of its new pictures, ``announces`` these, or does both; Done follows."""

    awaits: bool
    announces: bool


class About(Struct, array_like=True):
    """Of a service that has built its model: from where it sends on the bus, and its number of shared memories."""

    address: Address
    memories: int
    consumes: list[int]
    """Ids of the messages that it handles; empty for all."""


class Done(Struct, tag=True, array_like=True):
    """A service has done what it was to do, and sent these messages meanwhile; ``about`` is in the first one alone.

    ``pictures`` are new ones, ``sampled`` is when the newest was (us), and ``next`` when it has something to say next,
    0 when it does not know. ``awaited`` says that readers of new pictures wait for them already.
    """

    service: str
    messages: list[Envelope]
    pictures: int = 0
    sampled: int = 0
    next: int = 0
    ended: bool = False
    about: About | None = None
    awaited: bool = False


Message = Hello | Step | Show | Done
PACKET = 1 << 16
_LAST, _MORE = b"\0", b"\1"
_AGAIN_S, _HELLO_S = 0.005, 1.0
_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(Message).decode


@contextlib.contextmanager
def _short(path: Path) -> Iterator[str]:
    """The path of a socket in a form that an address can hold, however long the folder's is."""
    folder = os.open(path.parent, os.O_PATH)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


class Channel:
    """One end of a connection. A message longer than a packet takes several, of which the first byte says so."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)

    @classmethod
    def connect(cls, path: Path) -> Self:
        """Connects as soon as somebody listens."""
        while True:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            try:
                with _short(path) as address:
                    connection.connect(address)
            except (FileNotFoundError, ConnectionRefusedError):
                connection.close()
                time.sleep(_AGAIN_S)
            else:
                return cls(connection)

    def send(self, message: Message) -> None:
        """Sends a message; it is lost where the other end has gone."""
        data = _encode(message)
        with contextlib.suppress(OSError):
            while len(data) > PACKET:
                self._socket.send(_MORE + data[:PACKET])
                data = data[PACKET:]
            self._socket.send(_LAST + data)

    def receive(self, timeout: float) -> Message | None:
        """The next message within ``timeout`` seconds; raises EOFError when the other end has gone."""
        if not self._poll.poll(timeout * 1000):
            return None
        data, kind = b"", _MORE
        while kind == _MORE:
            try:
                packet = self._socket.recv(PACKET + 1)
            except ConnectionError:
                packet = b""
            if not packet:
                raise EOFError
            kind, data = packet[:1], data + packet[1:]
        message: Message = _decode(data)
        return message

    def fileno(self) -> int:
        """The file descriptor to poll for reading."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class Listener:
    """The end to which services connect, each of ``services`` once; others are turned away."""

    def __init__(self, path: Path, services: Iterable[str]) -> None:
        """Raises OSError."""
        self._path = path
        self.missing = set(services)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        path.unlink(missing_ok=True)
        with _short(path) as address:
            self._socket.bind(address)
        path.chmod(0o666)
        self._socket.listen(socket.SOMAXCONN)

    def accept(self, timeout: float) -> tuple[str, Channel] | None:
        """A service that connects within ``timeout`` seconds, with its name; nobody can behind the last one."""
        if not select.select([self._socket], [], [], timeout)[0]:
            return None
        channel = Channel(self._socket.accept()[0])
        try:
            hello = channel.receive(_HELLO_S)
        except (EOFError, msgspec.DecodeError):
            hello = None
        if not isinstance(hello, Hello) or hello.service not in self.missing:
            channel.close()
            return None
        self.missing.remove(hello.service)
        if not self.missing:
            self.close()
        return hello.service, channel

    def close(self) -> None:
        """Nobody else can connect."""
        self._socket.close()
        self._path.unlink(missing_ok=True)
