"""What containers print, as it comes, and a sender in a test's network: a program next to its recorder."""

import contextlib
import os
import socket
from collections.abc import Iterable
from typing import Any, BinaryIO

from dodo_dsl.opendlv.relay import BUS

_COMMAND = ("python", "-m", "dodo_dsl.opendlv.relay")
_START_S = 30.0
_CHUNK = 1 << 16
_HEADER_BYTES = 8
"""Before each piece of a program's output without a terminal; the last four are its length."""


def attached(container: Any) -> Any:
    """What a container prints from its start on, to be closed; raises DockerException and OSError."""
    return container.attach_socket(params={"stdin": 1, "stdout": 1, "stderr": 1, "stream": 1})


def type_into(answer: Any, data: bytes) -> None:
    """Types into an attached container's terminal, if it has one and its standard input is open."""
    with contextlib.suppress(OSError):
        _socket(answer).sendall(data)


def copy_into(answer: Any, is_terminal: bool, writer: int) -> None:
    """Copies output into a pipe, until the container ends or nobody reads the pipe; then closes both."""
    with contextlib.suppress(OSError), _socket(answer).makefile("rb") as output:
        while data := output.read1(_CHUNK) if is_terminal else _piece(output):
            while data:
                data = data[os.write(writer, data) :]
    close(answer)
    with contextlib.suppress(OSError):
        os.close(writer)


class ContainerRelay:
    """``Relay`` in the network of a container that has DoDo's programs.

    Raises DockerException, and OSError or ValueError where the program does not start.
    """

    def __init__(self, container: Any, cid: int) -> None:
        api = container.client.api
        self._exec = api.exec_create(container.id, [*_COMMAND, str(cid)], stdin=True, stdout=True, stderr=True)["Id"]
        self._answer = api.exec_start(self._exec, socket=True)
        self._stream = _socket(self._answer)
        self._stream.settimeout(_START_S)
        try:
            self._await_start()
        except (OSError, ValueError):
            self.close()
            raise

    def _await_start(self) -> None:
        data = b""
        with self._stream.makefile("rb") as output:
            while not data.endswith(b"\n") and (piece := _piece(output)):
                data += piece
        said = " ".join(data.decode("utf-8", "replace").split())
        if said != "ready":
            raise ValueError(f"the program that sends it says '{said[:200]}'")

    def send(self, data: bytes, to: Iterable[str] = (BUS,)) -> None:
        """Sends a datagram to services by their names, or loses it where the program has ended."""
        with contextlib.suppress(OSError):
            self._stream.sendall(" ".join([*to, f"{data.hex()}\n"]).encode())

    def close(self) -> None:
        close(self._answer)


def _socket(answer: Any) -> socket.socket:
    """The socket of an answer of the engine, which the docker package wraps unless it is TLS."""
    inner = getattr(answer, "_sock", answer)
    assert isinstance(inner, socket.socket), "the engine is reached by a socket"
    return inner


def close(answer: Any) -> None:
    """Closes the socket of an answer of the engine, and the response, which holds it open."""
    _socket(answer).close()
    if (response := getattr(answer, "_response", None)) is not None:
        response.close()


def _piece(output: BinaryIO) -> bytes:
    """Of what a program without a terminal prints; empty at its end."""
    return output.read(int.from_bytes(output.read(_HEADER_BYTES)[4:], "big"))
