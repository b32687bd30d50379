"""An image registry that ends the connection in the middle of a layer, each time."""

import hashlib
import json
import os
import socket
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from types import TracebackType
from typing import Any, Self

IMAGE = "broken:1"
TRIES = 6
"""How often an engine asks for a layer by default before it gives up."""
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
        self.server.breaks += 1  # type: ignore[attr-defined]
        self.send_response(200)
        self.send_header("Content-Length", str(len(_LAYER)))
        self.end_headers()
        self.wfile.write(_LAYER[: len(_LAYER) // 2])
        self.connection.shutdown(socket.SHUT_RDWR)
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


class BrokenRegistry:
    """Serves on 127.0.0.1 while it is entered; ``image`` is the reference of an image that never arrives."""

    def __enter__(self) -> Self:
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _Handler)
        self._server.breaks = 0  # type: ignore[attr-defined]
        self._thread = Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.image = f"127.0.0.1:{self._server.server_port}/{IMAGE}"
        return self

    @property
    def breaks(self) -> int:
        """How often the layer was asked for."""
        return int(self._server.breaks)  # type: ignore[attr-defined]

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
