"""What the editor shows, in place of what the files hold, and the specs that this makes."""

from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, Reader, parse_bytes, read
from dodo_dsl.spec.load import Loaded, load_spec
from dodo_dsl.spec.registry import Location

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


class LoadedSpecs:
    """The specs of files, loaded again only when a file that they were made of has changed."""

    def __init__(self) -> None:
        self._known: dict[Location, tuple[list[tuple[Path, Parsed]], Loaded]] = {}

    def __call__(self, location: Location, reader: Reader) -> Loaded:
        known = self._known.get(location)
        if known and all(reader(path) is parsed for path, parsed in known[0]):
            return known[1]
        made_of: list[tuple[Path, Parsed]] = []

        def recorded(path: Path) -> Parsed:
            made_of.append((path, reader(path)))
            return made_of[-1][1]

        self._known[location] = made_of, load_spec(location, recorded)
        return self._known[location][1]


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
