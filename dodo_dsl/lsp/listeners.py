"""What the language server listens to: changes of documents and files, and requests about a place."""

from collections.abc import Callable
from typing import Any, BinaryIO, TypeVar

from lsprotocol import types
from pygls.exceptions import JsonRpcInvalidParams

from dodo_dsl.lsp.completion import TRIGGERS, completion
from dodo_dsl.lsp.definition import definition
from dodo_dsl.lsp.edits.rename import prepare, rename
from dodo_dsl.lsp.hover import hover
from dodo_dsl.lsp.outline import outline
from dodo_dsl.lsp.scene import DocumentContext
from dodo_dsl.lsp.server import DodoServer, log

_WATCHED = "**/*.{yml,yaml,json,odvd,env}"
_Answer = TypeVar("_Answer")


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
    @server.feature(types.TEXT_DOCUMENT_HOVER)
    def _hover(params: types.HoverParams) -> types.Hover | None:
        return _answer(server, params, lambda scene: hover(scene, params.position))

    @server.feature(types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=TRIGGERS))
    def _completion(params: types.CompletionParams) -> types.CompletionList | None:
        return _answer(server, params, lambda scene: completion(scene, params.position))

    @server.feature(types.TEXT_DOCUMENT_DEFINITION)
    def _definition(params: types.DefinitionParams) -> types.Location | None:
        codec = server.workspace.position_codec
        return _answer(server, params, lambda scene: definition(scene, params.position, codec))

    @server.feature(types.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def _outline(params: types.DocumentSymbolParams) -> list[types.DocumentSymbol] | None:
        return _answer(server, params, outline)

    @server.feature(types.TEXT_DOCUMENT_PREPARE_RENAME)
    def _prepare_rename(params: types.PrepareRenameParams) -> types.Range | None:
        return _answer(server, params, lambda scene: prepare(scene, params.position))

    @server.feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))
    def _rename(params: types.RenameParams) -> types.WorkspaceEdit | None:
        return _answer(server, params, lambda scene: rename(scene, params.position, params.new_name))

    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )
    def _code_action(params: types.CodeActionParams) -> list[types.CodeAction]:
        return server.quick_fixes(params)


def _answer(server: DodoServer, params: Any, work: Callable[[DocumentContext], _Answer]) -> _Answer | None:
    """The answer to a request about a document; None where it fails, which the log then says."""
    try:
        scene = server.scene(params.text_document.uri)
        return work(scene) if scene else None
    except JsonRpcInvalidParams:
        raise  # a sentence for the user
    except Exception as error:  # noqa: BLE001
        log.exception("a request failed")
        server.say(f"a request failed: {type(error).__name__}: {error}")
        return None


def _watch(server: DodoServer) -> None:
    """Asks the editor to say when files change on disk, where it can."""
    workspace = server.client_capabilities.workspace
    watching = workspace.did_change_watched_files if workspace else None
    if not watching or not watching.dynamic_registration:
        return
    options = types.DidChangeWatchedFilesRegistrationOptions([types.FileSystemWatcher(_WATCHED)])
    wanted = types.Registration("dodo-files", types.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
    server.client_register_capability(types.RegistrationParams([wanted]))
