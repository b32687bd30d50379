"""The open documents of an editor, and files by their paths."""

from dataclasses import dataclass
from pathlib import Path

from pygls.uris import from_fs_path, to_fs_path
from pygls.workspace import Workspace

from dodo_dsl.source import MAX_BYTES


@dataclass(frozen=True)
class Document:
    """An open document with its resolved path; ``version`` counts its changes."""

    uri: str
    path: Path
    text: str
    version: int | None


def path_of(uri: str) -> Path | None:
    """The resolved path of a file's URI; None for anything else, such as a document that has no file yet."""
    text = to_fs_path(uri)
    try:
        return Path(text).resolve() if text else None
    except (OSError, RuntimeError, ValueError):
        return None


def uri_of(path: Path) -> str:
    return from_fs_path(str(path)) or path.as_uri()


def opened(workspace: Workspace) -> dict[Path, Document]:
    """The open documents that are files."""
    found = {}
    for uri, document in list(workspace.text_documents.items()):
        path = path_of(uri)
        if path is not None:
            found[path] = Document(uri, path, document.source, document.version)
    return found


def saved_text(path: Path) -> str:
    """The text of a file that is not open, as far as positions need it."""
    try:
        if not path.is_file():  # a FIFO would never end
            return ""
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES).decode("utf-8", "replace")
    except OSError:
        return ""
