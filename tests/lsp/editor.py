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
        answer = self.until(lambda m: m.get("id") == number and "method" not in m)
        assert "error" not in answer, answer
        return answer["result"]

    def until(self, fits: Callable[[Message], bool]) -> Message:
        """The first message that the condition holds for, of those that arrive from now on."""
        while True:
            message = self._arrived.get(timeout=PATIENCE_S)
            assert message is not None, "the server has ended"
            self.messages.append(message)
            if message.get("method") == "textDocument/publishDiagnostics":
                self.shown[message["params"]["uri"]] = message["params"]["diagnostics"]
            elif "id" in message and "method" in message:
                self.send(id=message["id"], result=None)
            if fits(message):
                return message

    def notify(self, event: str, path: Path, **document: Any) -> None:
        self.send(method=f"textDocument/{event}", params={"textDocument": {"uri": path.as_uri(), **document}})

    def open(self, path: Path) -> list[Message]:
        """Opens a file, and awaits its problems."""
        self.notify("didOpen", path, languageId="yaml", version=1, text=path.read_text())
        return self.problems(path)

    def save(self, path: Path, text: str) -> list[Message]:
        path.write_text(text)
        self.notify("didSave", path)
        return self.problems(path)

    def type(self, path: Path, text: str) -> None:
        """Changes the text and saves it."""
        document = {"uri": path.as_uri(), "version": next(self._versions)}
        self.send(
            method="textDocument/didChange", params={"textDocument": document, "contentChanges": [{"text": text}]}
        )
        path.write_text(text)
        self.notify("didSave", path)

    def problems(self, path: Path) -> list[Message]:
        """The problems of a file that are shown next."""
        shown = "textDocument/publishDiagnostics"
        self.until(lambda m: m.get("method") == shown and m["params"]["uri"] == path.as_uri())
        return self.shown[path.as_uri()]

    def leave(self) -> int:
        self.request("shutdown", None)
        self.send(method="exit")
        return self.process.wait(PATIENCE_S)


@contextmanager
def editor(folder: Path, command: Sequence[str] = (sys.executable, "-m", "dodo_dsl", "lsp")) -> Iterator[Editor]:
    """An editor that has opened a folder, with its server."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, cwd=folder, env=environment, **pipes)
    one = Editor(process)
    try:
        one.request("initialize", {"processId": None, "rootUri": folder.as_uri(), "capabilities": {}})
        one.send(method="initialized", params={})
        yield one
    finally:
        process.kill()
        process.wait()
        one.listener.join(PATIENCE_S)
        for pipe in (process.stdin, process.stdout, process.stderr):
            with suppress(BrokenPipeError):
                pipe.close()  # type: ignore[union-attr]
