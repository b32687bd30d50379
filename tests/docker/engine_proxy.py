"""Another socket to the engine, which can be cut."""

import contextlib
import os
import select
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
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(place))
        self._listener.listen(100)
        self.variables = {"DOCKER_HOST": f"unix://{place}"}

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
        """All that comes from either side, until one of them ends."""
        with contextlib.suppress(OSError), client, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as far:
            far.connect(str(self._engine))
            self._ends.append(far)
            while True:
                for source in select.select([client, far], [], [])[0]:
                    if not (data := source.recv(1 << 16)):
                        return
                    (far if source is client else client).sendall(data)
