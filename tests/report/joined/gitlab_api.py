"""A small server with GitLab's API for the jobs of a child pipeline, over a folder with their artifacts."""

import io
import json
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

PARENT, CHILD = 7, 8


@dataclass
class Api:
    """Serves ``artifacts``: a folder a job. ``tokens`` are the headers that came, ``refused`` paths that answer 401."""

    artifacts: Path
    url: str = ""
    tokens: list[tuple[str | None, str | None]] = field(default_factory=list)
    refused: str = "nothing"
    changed: dict[str, bytes] = field(default_factory=dict)
    """Answers in place of the true ones, by the end of the path."""

    def environment(self, **more: str) -> dict[str, str]:
        """The variables of a job of the parent pipeline."""
        known = {"CI_API_V4_URL": f"{self.url}/api/v4", "CI_PROJECT_ID": "3", "CI_PIPELINE_ID": str(PARENT)}
        return {**known, "CI_JOB_TOKEN": "secret", **more}

    def answer(self, path: str, page: int) -> bytes | None:
        for end, data in self.changed.items():
            if path.endswith(end):
                return data
        jobs = sorted(p.name for p in self.artifacts.iterdir() if p.is_dir()) if self.artifacts.is_dir() else []
        if path == f"/api/v4/projects/3/pipelines/{PARENT}/bridges":
            return _json([{"name": "other", "downstream_pipeline": None}, {"downstream_pipeline": {"id": CHILD}}])
        if path == f"/api/v4/projects/3/pipelines/{CHILD}/jobs":
            return _json([self._job(number, name) for number, name in enumerate(jobs, 1)][page - 1 : page])
        if path.startswith("/api/v4/projects/3/jobs/"):
            return _zipped(self.artifacts / jobs[int(path.split("/")[6]) - 1])
        return None

    def pages(self, path: str) -> int:
        return len(list(self.artifacts.iterdir())) if path.endswith("/jobs") else 1

    def _job(self, number: int, name: str) -> dict[str, Any]:
        kept = any((self.artifacts / name).iterdir())
        return {
            "id": number,
            "name": name,
            "status": "failed",
            **({"artifacts_file": {"filename": "x.zip"}} if kept else {}),
        }


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()


def _zipped(folder: Path) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder).as_posix())
    return buffer.getvalue()


@contextmanager
def serving(artifacts: Path) -> Iterator[Api]:
    api = Api(artifacts)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path, _, query = self.path.partition("?")
            page = int(query.rpartition("page=")[2] or 1)
            api.tokens.append((self.headers["JOB-TOKEN"], self.headers["PRIVATE-TOKEN"]))
            if path.endswith(api.refused):
                self.send_error(401, "Unauthorized")
                return
            data = api.answer(path, page)
            if data is None:
                self.send_error(404, "Not Found")
                return
            self.send_response(200)
            if page < api.pages(path):
                self.send_header("x-next-page", str(page + 1))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            """Says nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        api.url = f"http://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield api
        server.shutdown()
        thread.join()
