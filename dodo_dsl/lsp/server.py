"""A server of the language server protocol (LSP 3.17): when a file is opened or saved, it shows what is wrong.

It reads files as they are saved, and offers nothing else: completion and hover come from the schema of tests.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote, urlsplit

from dodo_dsl import __version__
from dodo_dsl.check import forget_files
from dodo_dsl.compiler import load, plan, without_unsatisfied
from dodo_dsl.diagnostics import Diagnostic, forget_lines, ordered
from dodo_dsl.source import MAX_BYTES
from dodo_dsl.spec.deployment import FILE_NAME, find_deployment, load_deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.registry import SUFFIX
from dodo_dsl.terminal import printable

Message = dict[str, Any]
_SEVERITIES = {"error": 1, "warning": 2}
_SYNC = {"openClose": True, "change": 0, "save": True}
_CAPABILITIES = {"textDocumentSync": _SYNC, "positionEncoding": "utf-16"}
_NO_METHOD, _ERROR = -32601, 1


def problems(files: Sequence[Path]) -> dict[Path, list[Diagnostic]]:
    """What is wrong in the projects of these tests and deployments, by file, as ``dodo compile --check`` finds it."""
    load_manifests.cache_clear()
    forget_files()
    forget_lines()
    projects: dict[Path, list[Path]] = {}
    for file in files:
        projects.setdefault(find_deployment(file.parent) or file, []).append(file)
    found: dict[Path, list[Diagnostic]] = {file: [] for file in files}
    for key, opened in projects.items():
        specs = [file for file in opened if file.name != FILE_NAME]
        registry = load_deployment(key)[0].registry if key.name == FILE_NAME else ()
        outside = [file for file in specs if not any(file.is_relative_to(folder.resolve()) for folder in registry)]
        checked = without_unsatisfied(load([*registry, *outside] if outside else [], start=key.parent), specs)
        sound = checked.sound()
        planned = plan(sound, key.parent / "generated").problems if sound.specs else ()
        for diagnostic in ordered([*checked.diagnostics, *planned]):
            found.setdefault(Path(diagnostic.span.file).resolve(), []).append(diagnostic)
    return found


def serve(stdin: BinaryIO, stdout: BinaryIO) -> None:
    """Speaks with one editor until it leaves."""
    server = _Server()
    while (message := _read(stdin)) is not None and message.get("method") != "exit":
        for answer in server.answers(message):
            body = json.dumps({"jsonrpc": "2.0", **answer}).encode()
            stdout.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
            stdout.flush()


def _read(stdin: BinaryIO) -> Message | None:
    size = 0
    while line := stdin.readline().strip():
        name, _, value = line.partition(b":")
        size = int(value) if name.lower() == b"content-length" else size
    message = json.loads(stdin.read(size)) if size else None
    return message if isinstance(message, dict) else None


class _Server:
    """``opened`` are the open tests and deployments with their URIs, ``shown`` the URIs of files with problems."""

    def __init__(self) -> None:
        self.opened: dict[Path, str] = {}
        self.shown: set[str] = set()

    def answers(self, message: Message) -> Iterator[Message]:
        method, params = message.get("method"), message.get("params") or {}
        if "id" in message:
            if method in ("initialize", "shutdown"):
                about = {"capabilities": _CAPABILITIES, "serverInfo": {"name": "dodo", "version": __version__}}
                yield {"id": message["id"], "result": about if method == "initialize" else None}
            elif method is not None:
                yield {"id": message["id"], "error": {"code": _NO_METHOD, "message": f"there is no '{method}'"}}
        elif method in ("textDocument/didOpen", "textDocument/didClose", "textDocument/didSave"):
            uri = params["textDocument"]["uri"]
            path = Path(unquote(urlsplit(uri).path)).resolve()
            if method == "textDocument/didClose":
                self.opened.pop(path, None)
            elif urlsplit(uri).scheme == "file" and (path.name == FILE_NAME or path.name.endswith(SUFFIX)):
                self.opened[path] = uri
            try:
                yield from self._published(problems([*self.opened]))
            except Exception as error:  # noqa: BLE001  (whatever fails, the server goes on)
                said = printable(f"the check failed: {type(error).__name__}: {error}")
                yield {"method": "window/logMessage", "params": {"type": _ERROR, "message": said}}

    def _published(self, found: Mapping[Path, Sequence[Diagnostic]]) -> Iterator[Message]:
        """The problems of each file; files that have none any more are cleared."""
        shown = {self.opened.get(path, path.as_uri()): _shown(path, of_file) for path, of_file in found.items()}
        for uri, diagnostics in {**{uri: [] for uri in sorted(self.shown)}, **shown}.items():
            yield {"method": "textDocument/publishDiagnostics", "params": {"uri": uri, "diagnostics": diagnostics}}
        self.shown = {uri for uri, diagnostics in shown.items() if diagnostics}


def _shown(path: Path, diagnostics: Sequence[Diagnostic]) -> list[Message]:
    lines: list[str] = []
    if diagnostics and path.is_file():
        with path.open("rb") as file:
            lines = file.read(MAX_BYTES).decode("utf-8-sig", "replace").splitlines()
    made = []
    for each in diagnostics:
        span = each.span
        text = lines[span.line - 1] if span.line <= len(lines) else ""
        ends = (_units(text[: span.column - 1]), _units(text[: span.column - 1 + span.length]))
        start, end = ({"line": span.line - 1, "character": units} for units in ends)
        message = printable(each.sentence) + (f"\n{printable(each.hint)}" if each.hint else "")
        about = {"severity": _SEVERITIES[each.severity], "code": each.rule, "source": "dodo", "message": message}
        made.append({"range": {"start": start, "end": end}, **about})
    return made


def _units(text: str) -> int:
    """Code units of UTF-16, in which editors count."""
    return len(text.encode("utf-16-le", "replace")) // 2
