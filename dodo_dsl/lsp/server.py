"""The language server: it listens to the editor, and says what is wrong a moment after a change."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from lsprotocol import types
from pygls.lsp.server import LanguageServer

from dodo_dsl import __version__
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.documents import Document, opened, saved_text, uri_of
from dodo_dsl.lsp.positions import Lines
from dodo_dsl.lsp.project import Project, by_file, forget, is_ours, projects
from dodo_dsl.lsp.texts import Texts
from dodo_dsl.terminal import printable

PAUSE_S = 0.05
"""After the last change, before a check begins."""
_IDLE_S = 0.5  # before all tests are planned
_WATCHED = "**/*.{yml,yaml,json,odvd,env}"
_SEVERITIES = {"error": types.DiagnosticSeverity.Error, "warning": types.DiagnosticSeverity.Warning}
_log = logging.getLogger(__name__)
_Answer = TypeVar("_Answer")


class DodoServer(LanguageServer):
    """One editor's server. Texts come whole, as editors and Python do not agree on what ends a line."""

    def __init__(self) -> None:
        super().__init__("dodo", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Full)
        self.projects: Sequence[Project] = ()
        self._texts = Texts()
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] | None = None
        self._stale = asyncio.Event()
        self._published: set[str] = set()

    def lines(self, text: str) -> Lines:
        return Lines(text, self.workspace.position_codec)

    def log(self, message: str) -> None:
        self.window_log_message(types.LogMessageParams(types.MessageType.Error, printable(message)))

    def report_server_error(self, error: Exception, source: Any) -> None:
        """Errors are messages of the log and not of a window."""
        _log.error("%s", error, exc_info=error)
        self.log(f"internal error: {error}")

    def changed(self, *, elsewhere: bool = False) -> None:
        """Begins a check soon; ``elsewhere`` where other files than tests may have changed."""
        if elsewhere:
            forget()
        if self._timer:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(PAUSE_S, self._begin)

    def _begin(self) -> None:
        self._stale.set()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._check())

    async def _check(self) -> None:
        """Checks until nothing has changed meanwhile; whatever fails, the server goes on."""
        while self._stale.is_set():
            self._stale.clear()
            try:
                await self._check_once()
            except Exception as error:  # noqa: BLE001
                _log.exception("the check failed")
                self.log(f"the check failed: {type(error).__name__}: {error}")

    async def _check_once(self) -> None:
        """Checks each test, and plans all tests together if nothing changes for a while."""
        documents = opened(self.workspace)
        self.projects = await asyncio.to_thread(self._checked, documents)
        found = [problem for project in self.projects for problem in project.checked.diagnostics]
        self._publish(documents, found)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._stale.wait(), _IDLE_S)
        if not self._stale.is_set():
            planned = await asyncio.to_thread(_planned, self.projects)
            if planned and not self._stale.is_set():
                self._publish(documents, [*found, *planned])

    def _checked(self, documents: Mapping[Path, Document]) -> list[Project]:
        self._texts.show({path: document.text for path, document in documents.items()})
        return projects((path for path in documents if is_ours(path)), self._texts)

    def _publish(self, documents: Mapping[Path, Document], found: Iterable[Diagnostic]) -> None:
        """Shows the problems of each file, and clears files and open documents without any."""
        grouped = by_file(found)
        messages: dict[str, types.PublishDiagnosticsParams] = {}
        for path in {*grouped, *(path for path in documents if is_ours(path))}:
            document = documents.get(path)
            lines = self.lines(document.text if document else saved_text(path))
            shown = [_shown(lines, diagnostic) for diagnostic in sorted(set(grouped.get(path, ())))]
            uri = document.uri if document else uri_of(path)
            messages[uri] = types.PublishDiagnosticsParams(uri, shown, document.version if document else None)
        for uri in self._published - messages.keys():
            self.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, []))
        for message in messages.values():
            self.text_document_publish_diagnostics(message)
        self._published = {uri for uri, message in messages.items() if message.diagnostics}


def _planned(found: Sequence[Project]) -> list[Diagnostic]:
    return [problem for project in found for problem in project.planned()]


def _shown(lines: Lines, diagnostic: Diagnostic) -> types.Diagnostic:
    hint = f"\n{printable(diagnostic.hint)}" if diagnostic.hint else ""
    return types.Diagnostic(
        lines.range(diagnostic.span),
        printable(diagnostic.message) + hint,
        _SEVERITIES[diagnostic.severity],
        diagnostic.rule,
        source="dodo",
    )


def guarded(server: DodoServer, answer: Callable[..., _Answer]) -> Callable[..., _Answer | None]:
    """An answer to a request that is empty where it fails, which the log then says."""

    def safe(params: Any) -> _Answer | None:
        try:
            return answer(server, params)
        except Exception as error:  # noqa: BLE001
            _log.exception("a request failed")
            server.log(f"a request failed: {type(error).__name__}: {error}")
            return None

    return safe


def build() -> DodoServer:
    """The server with everything that it listens to."""
    server = DodoServer()

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def _opened(_: types.DidOpenTextDocumentParams) -> None:
        server.changed(elsewhere=True)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def _changed(params: types.DidChangeTextDocumentParams) -> None:
        server.changed(elsewhere=params.text_document.uri.endswith("/service.yml"))

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def _closed(_: types.DidCloseTextDocumentParams) -> None:
        server.changed(elsewhere=True)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def _saved(_: types.DidSaveTextDocumentParams) -> None:
        server.changed(elsewhere=True)

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def _watched(_: types.DidChangeWatchedFilesParams) -> None:
        server.changed(elsewhere=True)

    @server.feature(types.INITIALIZED)
    async def _initialized(_: types.InitializedParams) -> None:
        await _watch(server)

    return server


async def _watch(server: DodoServer) -> None:
    """Asks the editor to say when files change on disk, where it can."""
    workspace = server.client_capabilities.workspace
    watching = workspace.did_change_watched_files if workspace else None
    if not watching or not watching.dynamic_registration:
        return
    options = types.DidChangeWatchedFilesRegistrationOptions([types.FileSystemWatcher(_WATCHED)])
    wanted = types.Registration("dodo-files", types.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
    await server.client_register_capability_async(types.RegistrationParams([wanted]))


def serve(stdin: BinaryIO, stdout: BinaryIO) -> None:
    """Speaks with one editor until it leaves."""
    build().start_io(stdin, stdout)
