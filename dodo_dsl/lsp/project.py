"""The tests around the open files: which belong together, and what is wrong with them.

What the editor shows counts in place of what the files hold.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

from dodo_dsl.check import forget_files
from dodo_dsl.compiler import Checked, load, without_unsatisfied
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, parse_bytes, read
from dodo_dsl.spec.deployment import FILE_NAME, find_deployment, load_deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.registry import SUFFIX

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


def is_ours(path: Path) -> bool:
    """Whether a file is a test or a deployment."""
    return path.name == FILE_NAME or path.name.endswith(SUFFIX)


class Projects:
    """The projects of the open tests and deployments."""

    def __init__(self) -> None:
        self._texts = Texts()
        self._is_outdated = False

    def forget(self) -> None:
        """Anything may have changed: manifests, maps, messages. The next check looks at all of it."""
        self._is_outdated = True

    def check(self, shown: Mapping[Path, str]) -> list[Checked]:
        """The projects, checked with the texts that are shown, by resolved path."""
        if self._is_outdated:
            self._is_outdated = False
            load_manifests.cache_clear()
            forget_files()
        self._texts.show(shown)
        groups: dict[Path, list[Path]] = {}
        for file in sorted(filter(is_ours, shown)):
            groups.setdefault(find_deployment(file.parent) or file, []).append(file)
        return [self._project(key, files) for key, files in groups.items()]

    def _project(self, key: Path, files: list[Path]) -> Checked:
        specs = [file for file in files if file.name.endswith(SUFFIX)]
        paths = specs
        if key.name == FILE_NAME:
            registry = load_deployment(key, self._texts)[0].registry
            outside = [file for file in specs if not any(file.is_relative_to(folder) for folder in registry)]
            paths = [*registry, *outside] if outside else []
        return without_unsatisfied(load(paths, start=key.parent, reader=self._texts), specs)


def by_file(found: Iterable[Diagnostic]) -> Mapping[Path, list[Diagnostic]]:
    """Problems by the resolved path of their file."""
    grouped: dict[Path, list[Diagnostic]] = {}
    for diagnostic in found:
        grouped.setdefault(Path(diagnostic.span.file).resolve(), []).append(diagnostic)
    return grouped
