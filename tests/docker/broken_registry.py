"""An image registry that ends the connection in the middle of a layer.

An engine asks again, six times in more than a minute by default. To make it give up at once, a forgetful registry says
at the second time that it has no such layer.
"""

import contextlib
import hashlib
import json
import os
import socket
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

IMAGE = "broken:1"
_MANIFEST = "application/vnd.docker.distribution.manifest.v2+json"
_LAYER = os.urandom(1 << 20)


def _digest(data: bytes) -> str:
    return f"sha256:{hashlib.sha256(data).hexdigest()}"


def _described(kind: str, data: bytes) -> dict[str, Any]:
    return {"mediaType": kind, "size": len(data), "digest": _digest(data)}


def _manifest(config: bytes) -> bytes:
    layer = _described("application/vnd.docker.image.rootfs.diff.tar.gzip", _LAYER)
    about = _described("application/vnd.docker.container.image.v1+json", config)
    return json.dumps({"schemaVersion": 2, "mediaType": _MANIFEST, "config": about, "layers": [layer]}).encode()


_CONFIG = json.dumps({"os": "linux", "rootfs": {"type": "layers", "diff_ids": [_digest(_LAYER)]}}).encode()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_GET(self) -> None:
        if "/manifests/" in self.path:
            self._answer(_manifest(_CONFIG), _MANIFEST)
        elif self.path.endswith(_digest(_CONFIG)):
            self._answer(_CONFIG, "application/octet-stream")
        elif "/blobs/" in self.path:
            self._break_off()
        else:
            self._answer(b"{}", "application/json")

    def _answer(self, body: bytes, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Docker-Content-Digest", _digest(body))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(body)

    def _break_off(self) -> None:
        server = self.server
        assert isinstance(server, _Server)
        server.breaks += 1
        if server.is_forgetful and server.breaks > 1:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(_LAYER)))
        self.end_headers()
        self.wfile.write(_LAYER[: len(_LAYER) // 2])
        self.connection.shutdown(socket.SHUT_RDWR)
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


class _Server(ThreadingHTTPServer):
    """``image`` is the reference of one that never arrives; ``breaks`` is how often its layer was asked for."""

    breaks = 0
    is_forgetful = False

    @property
    def image(self) -> str:
        return f"127.0.0.1:{self.server_port}/{IMAGE}"


@contextlib.contextmanager
def broken_registry(is_forgetful: bool = False) -> Iterator[_Server]:
    """Serves on 127.0.0.1."""
    with _Server(("127.0.0.1", 0), _Handler) as server:
        server.is_forgetful = is_forgetful
        Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()
