"""What answers like an engine that is asked for its version, on a TCP port, with or without TLS."""

import contextlib
import json
import ssl
import subprocess
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

VERSION = {"Version": "99.0", "ApiVersion": "1.41", "MinAPIVersion": "1.12"}


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        body = json.dumps(VERSION).encode() if self.path.endswith("/version") else b"OK"
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Says nothing."""


class _Server(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Clients that speak otherwise are what the tests try."""


@contextlib.contextmanager
def engine_stub(certificates: Path | None = None) -> Iterator[str]:
    """Its address as in ``DOCKER_HOST``; with ``certificates`` it takes only clients that have these."""
    server = _Server(("127.0.0.1", 0), _Handler)
    if certificates:
        context = tls_context(certificates)
        server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield f"tcp://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def tls_context(certificates: Path) -> ssl.SSLContext:
    """TLS of an engine that takes only clients with a certificate of its own authority."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificates / "cert.pem", certificates / "key.pem")
    context.load_verify_locations(certificates / "ca.pem")
    context.verify_mode = ssl.CERT_REQUIRED
    return context


def make_certificates(folder: Path, address: str = "127.0.0.1") -> Path:
    """A folder with ``ca.pem``, ``cert.pem`` and ``key.pem`` for an address, as ``DOCKER_CERT_PATH`` has them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "names").write_text(f"subjectAltName=IP:{address}\n")
    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    for words in (
        ["req", "-x509", *key, "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=engines", "-days", "3"],
        ["req", *key, "-keyout", "key.pem", "-out", "own.csr", "-subj", "/CN=engine"],
        ["x509", "-req", "-in", "own.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-out", "cert.pem",
         "-days", "3", "-extfile", "names"],
    ):  # fmt: skip
        subprocess.run(["openssl", *words], cwd=folder, capture_output=True, check=True)
    return folder
