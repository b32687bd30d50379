"""What containers print, as it comes, and a sender in a test's network: a program next to its recorder."""

import contextlib
import errno
import os
import socket
import subprocess
from collections.abc import Iterable
from typing import Any, BinaryIO

from dodo_dsl.application import secret_variables
from dodo_dsl.opendlv.relay import BUS

_COMMAND = ("python", "-m", "dodo_dsl.opendlv.relay")
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
    """``Relay`` in the network of a container that has DoDo's programs; raises OSError where it does not start."""

    def __init__(self, container: str, cid: int) -> None:
        words = ["docker", "exec", "--interactive", container, *_COMMAND, str(cid)]
        self._process = subprocess.Popen(
            words, env=secret_variables.of_client(os.environ), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, start_new_session=True
        )  # fmt: skip
        assert self._process.stdin and self._process.stdout
        self._input, output = self._process.stdin, self._process.stdout
        if (said := output.readline().strip()) != b"ready":
            self.close()
            raise OSError(errno.EPIPE, f"the program that sends it says '{said[:200].decode(errors='replace')}'")

    def send(self, data: bytes, to: Iterable[str] = (BUS,)) -> None:
        """Sends a datagram to services by their names, or loses it where the program has ended."""
        with contextlib.suppress(OSError):
            self._input.write(" ".join([*to, f"{data.hex()}\n"]).encode())
            self._input.flush()

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()


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
