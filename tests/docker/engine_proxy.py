"""A socket in front of the engine's that can be cut: to its clients, the engine has gone."""

import contextlib
import os
import socket
import threading
from pathlib import Path
from types import TracebackType
from typing import Self


def engine_socket() -> Path | None:
    """The engine's socket of this machine; None where the engine is reached in another way."""
    host = os.environ.get("DOCKER_HOST", "unix:///var/run/docker.sock")
    path = Path(host.removeprefix("unix://"))
    return path if host.startswith("unix://") and path.is_socket() else None


class EngineProxy:
    """Hands everything through while it is entered and not cut; ``variables`` lead clients to it."""

    def __init__(self, engine: Path, place: Path) -> None:
        self._engine = engine
        self._place = place
        self._open: list[socket.socket] = []
        self._passing: list[threading.Thread] = []
        self.variables = {"DOCKER_HOST": f"unix://{place}"}

    def __enter__(self) -> Self:
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(self._place))
        self._listener.listen(100)
        self._accepting = threading.Thread(target=self._accept)
        self._accepting.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.cut()
        self._accepting.join()
        for thread in self._passing:
            thread.join()
        for end in [self._listener, *self._open]:
            end.close()

    def cut(self) -> None:
        """Ends every connection and takes no more."""
        self._place.unlink(missing_ok=True)
        for end in [self._listener, *self._open]:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            engine = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            engine.connect(str(self._engine))
            self._open += [client, engine]
            for ends in ((client, engine), (engine, client)):
                self._passing.append(threading.Thread(target=_pass_on, args=ends))
                self._passing[-1].start()


def _pass_on(source: socket.socket, target: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(1 << 16):
            target.sendall(data)
    with contextlib.suppress(OSError):
        target.shutdown(socket.SHUT_WR)
