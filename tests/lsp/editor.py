"""An editor that speaks with ``dodo lsp`` through its pipes."""

import itertools
import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

PATIENCE_S = 60
ROOT = Path(__file__).parents[2]
Message = dict[str, Any]


class Editor:
    """Keeps every message of the server; ``shown`` has the last problems of each file."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process
        self.messages: list[Message] = []
        self.shown: dict[str, list[Message]] = {}
        self._arrived: queue.Queue[Message | None] = queue.Queue()
        self._ids = itertools.count(1)
        self._versions = itertools.count(1)
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def _listen(self) -> None:
        assert self.process.stdout
        while header := self.process.stdout.readline():
            name, _, size = header.partition(b":")
            assert name == b"Content-Length", header
            while self.process.stdout.readline().strip():
                pass
            self._arrived.put(json.loads(self.process.stdout.read(int(size))))
        self._arrived.put(None)

    def send(self, **message: Any) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self.process.stdin
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def request(self, method: str, params: Any) -> Any:
        number = next(self._ids)
        self.send(id=number, method=method, params=params)
        (answer,) = self.until(lambda m: m.get("id") == number and "method" not in m)
        assert "error" not in answer, answer
        return answer["result"]

    def until(self, *wanted: Callable[[Message], bool]) -> list[Message]:
        """The first message that each of the conditions holds for, of those that arrive from now on."""
        found: list[Message | None] = [None] * len(wanted)
        while None in found:
            message = self._arrived.get(timeout=PATIENCE_S)
            assert message is not None, "the server has ended"
            self.messages.append(message)
            if message.get("method") == "textDocument/publishDiagnostics":
                self.shown[message["params"]["uri"]] = message["params"]["diagnostics"]
            elif "id" in message and "method" in message:
                self.send(id=message["id"], result=None)
            found = [f or (message if fits(message) else None) for f, fits in zip(found, wanted, strict=True)]
        return [message for message in found if message]

    def open(self, path: Path, text: str | None = None) -> list[Message]:
        """Opens a file, perhaps with another text than it holds, and awaits its problems."""
        document = {"uri": path.as_uri(), "languageId": "yaml", "version": next(self._versions)}
        document["text"] = path.read_text() if text is None else text
        self.send(method="textDocument/didOpen", params={"textDocument": document})
        return self.problems(path, document["version"])

    def change(self, path: Path, text: str) -> list[Message]:
        version = self.type(path, text)
        return self.problems(path, version)

    def type(self, path: Path, text: str) -> int:
        version = next(self._versions)
        document = {"uri": path.as_uri(), "version": version}
        params = {"textDocument": document, "contentChanges": [{"text": text}]}
        self.send(method="textDocument/didChange", params=params)
        return version

    def close(self, path: Path) -> None:
        self.send(method="textDocument/didClose", params={"textDocument": {"uri": path.as_uri()}})

    def problems(self, path: Path, version: int | None = None) -> list[Message]:
        """The problems of a file that are shown next, for a version of its text."""
        uri = path.as_uri()

        def fits(message: Message) -> bool:
            params = message.get("params") or {}
            about = message.get("method") == "textDocument/publishDiagnostics" and params["uri"] == uri
            return about and (version is None or params.get("version") == version)

        (message,) = self.until(fits)
        found: list[Message] = message["params"]["diagnostics"]
        return found

    def leave(self) -> int:
        self.request("shutdown", None)
        self.send(method="exit")
        return self.process.wait(PATIENCE_S)


@contextmanager
def editor(
    folder: Path, encodings: list[str] | None = None, command: Sequence[str] = (sys.executable, "-m", "dodo_dsl", "lsp")
) -> Iterator[Editor]:
    """An editor that has opened a folder, with its server."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, cwd=folder, env=environment, **pipes)
    one = Editor(process)
    try:
        general = {"positionEncodings": encodings} if encodings else {}
        capabilities = {"general": general, "workspace": {"didChangeWatchedFiles": {"dynamicRegistration": True}}}
        params = {"processId": None, "rootUri": folder.as_uri(), "capabilities": capabilities}
        one.request("initialize", params)
        one.send(method="initialized", params={})
        yield one
    finally:
        process.kill()
        process.wait()
        one.listener.join(PATIENCE_S)
        for pipe in (process.stdin, process.stdout, process.stderr):
            with suppress(BrokenPipeError):
                pipe.close()  # type: ignore[union-attr]
