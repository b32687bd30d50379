"""A TCP port in front of the engine's socket, with or without TLS, as an engine in Docker-in-Docker has one."""

import contextlib
import select
import socket
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path

from tests.run.docker.engine_stub import tls_context


@contextlib.contextmanager
def engine_port(engine: Path, certificates: Path | None = None) -> Iterator[dict[str, str]]:
    """The variables that lead clients to it; with ``certificates`` those of ``make_certificates`` are needed."""
    context = tls_context(certificates) if certificates else None
    ends: list[socket.socket] = []
    threads: list[threading.Thread] = []

    def accept() -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            ends.append(client)
            threads.append(threading.Thread(target=_pass_on, args=(client, engine, context, ends)))
            threads[-1].start()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        accepting = threading.Thread(target=accept)
        accepting.start()
        variables = {"DOCKER_HOST": f"tcp://127.0.0.1:{listener.getsockname()[1]}"}
        tls = {"DOCKER_TLS_VERIFY": "1", "DOCKER_CERT_PATH": str(certificates)} if certificates else {}
        try:
            yield {**variables, **tls}
        finally:
            for end in [listener, *ends]:
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
            for thread in [accepting, *threads]:
                thread.join()


def _pass_on(client: socket.socket, engine: Path, context: ssl.SSLContext | None, ends: list[socket.socket]) -> None:
    """All that comes from either side, until one of them ends; one thread, as a TLS socket bears no more.

    The engine's side is one of ``ends``, as TLS takes the descriptor of the client's.
    """
    with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
        near = stack.enter_context(context.wrap_socket(client, server_side=True) if context else client)
        far = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        far.connect(str(engine))
        ends.append(far)
        while True:
            waiting = isinstance(near, ssl.SSLSocket) and near.pending() > 0
            ready = [near] if waiting else select.select([near, far], [], [])[0]
            for source in ready:
                data = source.recv(1 << 16)
                if not data:
                    return
                (far if source is near else near).sendall(data)
