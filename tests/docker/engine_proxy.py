"""A way to the engine's socket that can be cut: another socket, or a TCP port with or without TLS."""

import contextlib
import os
import select
import socket
import ssl
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.run.docker.engine_stub import tls_context


def engine_socket() -> Path | None:
    """The engine's socket of this machine; None where the engine is reached in another way."""
    host = os.environ.get("DOCKER_HOST", "unix:///var/run/docker.sock")
    path = Path(host.removeprefix("unix://"))
    return path if host.startswith("unix://") and path.is_socket() else None


class EngineProxy:
    """Hands everything through while it is entered and not cut; ``variables`` lead clients to it.

    It is at ``place``, or a port of 127.0.0.1; with ``certificates`` clients need those of ``make_certificates``.
    """

    def __init__(self, engine: Path, place: Path | None = None, certificates: Path | None = None) -> None:
        self._engine = engine
        self._context = tls_context(certificates) if certificates else None
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]
        if place:
            self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self._listener.bind(str(place))
            self._listener.listen(100)
            self.variables = {"DOCKER_HOST": f"unix://{place}"}
        else:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self.variables = {"DOCKER_HOST": f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"}
        if certificates:
            self.variables |= {"DOCKER_TLS_VERIFY": "1", "DOCKER_CERT_PATH": str(certificates)}

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.cut()
        for thread in self._threads:
            thread.join()
        self._listener.close()

    def cut(self) -> None:
        """Ends every connection and takes no more."""
        for end in [self._listener, *self._ends]:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                self._ends.append(client)
                self._threads.append(threading.Thread(target=self._pass_on, args=[client]))
                self._threads[-1].start()

    def _pass_on(self, client: socket.socket) -> None:
        """All that comes from either side, until one of them ends; one thread, as a TLS socket bears no more.

        The engine's side is one of ``_ends``, as TLS takes the descriptor of the client's.
        """
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            near = stack.enter_context(self._context.wrap_socket(client, server_side=True) if self._context else client)
            far = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            far.connect(str(self._engine))
            self._ends.append(far)
            while True:
                waiting = isinstance(near, ssl.SSLSocket) and near.pending() > 0
                for source in [near] if waiting else select.select([near, far], [], [])[0]:
                    data = source.recv(1 << 16)
                    if not data:
                        return
                    (far if source is near else near).sendall(data)
