"""What the editor shows, in place of what the files hold."""

from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, parse_bytes, read

Parsed = tuple[Node | None, list[Diagnostic]]


class Texts:
    """A reader (``dodo_dsl.source.Reader``) that prefers the texts it was shown, and reads what changed only."""

    def __init__(self) -> None:
        self._shown: dict[Path, str] = {}
        self._names: frozenset[str] = frozenset()
        self._parsed: dict[Path, tuple[object, Parsed]] = {}

    def show(self, texts: Mapping[Path, str]) -> None:
        """The texts of the open files by their resolved paths; all others are read from disk."""
        self._shown = dict(texts)
        self._names = frozenset(path.name for path in texts)

    def __call__(self, path: Path) -> Parsed:
        text = self._shown.get(path.resolve()) if path.name in self._names else None
        version = text if text is not None else _version(path)
        known = self._parsed.get(path)
        if known is None or version is None or known[0] != version:
            known = version, read(path) if text is None else parse_text(text, path)
            self._parsed[path] = known
        return known[1]


def parse_text(text: str, path: Path) -> Parsed:
    """The document of an editor's text, with the limits of a file."""
    return parse_bytes(text.encode("utf-8", "surrogatepass"), str(path))


def _version(path: Path) -> tuple[int, int, int] | None:
    """What changes with a regular file's content; None for anything else."""
    try:
        status = path.stat() if path.is_file() else None
    except OSError:
        return None
    return (status.st_mtime_ns, status.st_size, status.st_ino) if status else None
