"""The language server: it listens to the editor, and shows what is wrong a moment after a change, and its fixes."""

import asyncio
import logging
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from lsprotocol import types
from lsprotocol.types import Diagnostic as ShownDiagnostic
from pygls.lsp.server import LanguageServer

from dodo_dsl import __version__
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.documents import Document, Lines, opened, path_of, saved_text, uri_of
from dodo_dsl.lsp.edits import quick_fixes
from dodo_dsl.lsp.project import Projects, by_file, is_ours
from dodo_dsl.terminal import printable

PAUSE_S = 0.05
"""After the last change, before a check begins."""
_SEVERITIES = {"error": types.DiagnosticSeverity.Error, "warning": types.DiagnosticSeverity.Warning}
log = logging.getLogger(__name__)


class DodoServer(LanguageServer):
    """One editor's server. Texts come whole, as editors and Python do not agree on what ends a line."""

    def __init__(self) -> None:
        super().__init__("dodo", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Full)
        self._checker = Projects()
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] | None = None
        self._stale = asyncio.Event()
        self._published: set[str] = set()
        self._found: Mapping[Path, Sequence[Diagnostic]] = {}

    def lines(self, text: str) -> Lines:
        return Lines(text, self.workspace.position_codec)

    def quick_fixes(self, params: types.CodeActionParams) -> list[types.CodeAction]:
        """The fixes of the problems that the last check found in a document, of whatever kind its file is."""
        uri = params.text_document.uri
        path = path_of(uri)
        found = self._found.get(path, ()) if path else ()
        lines = self.lines(self.workspace.get_text_document(uri).source) if found else self.lines("")
        return list(quick_fixes(found, uri, lines, params))

    def say(self, message: str) -> None:
        self.window_log_message(types.LogMessageParams(types.MessageType.Error, printable(message)))

    def report_server_error(self, error: Exception, source: Any) -> None:
        """Errors are messages of the log and not of a window."""
        log.error("%s", error, exc_info=error)
        self.say(f"internal error: {error}")

    def changed(self, *, elsewhere: bool = False) -> None:
        """Begins a check soon; ``elsewhere`` where other files than tests may have changed."""
        if elsewhere:
            self._checker.forget()
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
                documents = opened(self.workspace)
                projects = await asyncio.to_thread(self._checker.check, {p: d.text for p, d in documents.items()})
                self._publish(documents, (problem for project in projects for problem in project.diagnostics))
            except Exception as error:
                log.exception("the check failed")
                self.say(f"the check failed: {type(error).__name__}: {error}")

    def _publish(self, documents: Mapping[Path, Document], found: Iterable[Diagnostic]) -> None:
        """Shows the problems of each file, and clears files and open documents without any."""
        grouped = self._found = by_file(found)
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


def _shown(lines: Lines, diagnostic: Diagnostic) -> ShownDiagnostic:
    hint = f"\n{printable(diagnostic.hint)}" if diagnostic.hint else ""
    return ShownDiagnostic(
        lines.range(diagnostic.span),
        printable(diagnostic.sentence) + hint,
        _SEVERITIES[diagnostic.severity],
        diagnostic.rule,
        source="dodo",
    )


_WATCHED = "**/*.{yml,yaml,json,odvd,env}"


def build() -> DodoServer:
    """The server with everything that it listens to."""
    server = DodoServer()
    _changes(server)
    _requests(server)
    return server


def serve(stdin: BinaryIO, stdout: BinaryIO) -> None:
    """Speaks with one editor until it leaves."""
    build().start_io(stdin, stdout)


def _changes(server: DodoServer) -> None:
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
    def _initialized(_: types.InitializedParams) -> None:
        _watch(server)


def _requests(server: DodoServer) -> None:
    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )
    def _code_action(params: types.CodeActionParams) -> list[types.CodeAction]:
        return server.quick_fixes(params)


def _watch(server: DodoServer) -> None:
    """Asks the editor to say when files change on disk, if it can."""
    workspace = server.client_capabilities.workspace
    watching = workspace.did_change_watched_files if workspace else None
    if not watching or not watching.dynamic_registration:
        return
    options = types.DidChangeWatchedFilesRegistrationOptions([types.FileSystemWatcher(_WATCHED)])
    wanted = types.Registration("dodo-files", types.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
    server.client_register_capability(types.RegistrationParams([wanted]))
