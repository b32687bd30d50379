"""What the editor shows, in place of what the files hold, and what a change of it can affect."""

import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dodo_dsl.check import check
from dodo_dsl.check.resolve import resolve
from dodo_dsl.compiler import CheckInputs, Ruled, Sources
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, Reader, parse_bytes, read
from dodo_dsl.spec.load import Loaded, load_spec
from dodo_dsl.spec.model import Spec
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


class ChangedSources(Sources):
    """Those of one project, which load and check again only what a change can affect."""

    def __init__(self, start: Path, texts: Texts) -> None:
        super().__init__(start, texts)
        self._loaded: dict[Location, tuple[list[tuple[Path, Parsed]], Loaded]] = {}
        self._inputs: CheckInputs | None = None
        self._ruled: Ruled = (), {}

    def load(self, locations: Iterable[Location]) -> dict[Path, Loaded]:
        """Loads again only where a file that specs were made of has changed."""
        once = functools.cache(self.read)
        return {location.path: self._load(location, once) for location in locations}

    def _load(self, location: Location, reader: Reader) -> Loaded:
        known = self._loaded.get(location)
        if known and all(reader(path) is parsed for path, parsed in known[0]):
            return known[1]
        made_of: list[tuple[Path, Parsed]] = []

        def recorded(path: Path) -> Parsed:
            made_of.append((path, reader(path)))
            return made_of[-1][1]

        self._loaded[location] = made_of, load_spec(location, recorded)
        return self._loaded[location][1]

    def check(self, specs: Sequence[Spec], corners: Sequence[Spec], inputs: CheckInputs) -> Ruled:
        """Instances that are the very objects of the check before keep what it found.

        A test is checked again, too, where another one took or gave up its name.
        """
        former, found = self._ruled if self._inputs == inputs else ((), {})
        known = {id(test.spec): test for test in former}
        new = [spec for spec in specs if id(spec) not in known]
        paths = {spec.path for spec in new}
        fresh = {id(test.spec): test for test in resolve((s for s in specs if s.path in paths), *inputs)}
        tests = tuple(fresh.get(id(spec)) or known[id(spec)] for spec in specs)
        here = {id(spec) for spec in specs}
        gone = [test.spec for key, test in known.items() if key not in here]
        names = {spec.name for spec in (*new, *gone)}
        affected = {spec.path for spec in specs if spec.name in names} | paths | {spec.path for spec in gone}
        at_ends = resolve((corner for corner in corners if corner.path in affected), *inputs)
        again = {**found, **check(tests, *inputs, at_ends, affected)}
        self._inputs, self._ruled = inputs, (tests, {spec.path: again[spec.path] for spec in specs})
        return self._ruled


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
