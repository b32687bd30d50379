"""The tests around the open files: which belong together, and what is wrong with them.

What the editor shows counts in place of what the files hold. What a change cannot affect is not checked again.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dodo_dsl.check import check, forget_files
from dodo_dsl.check.resolve import resolve
from dodo_dsl.compiler import Checked, CheckInputs, CheckResult, Sources, load, without_unsatisfied
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, Reader, parse_bytes, read
from dodo_dsl.spec.deployment import FILE_NAME, find_deployment, load_deployment
from dodo_dsl.spec.load import Loaded, load_spec
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import SUFFIX, Location

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
        self._result = CheckResult()

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

    def check(self, specs: Sequence[Spec], corners: Sequence[Spec], inputs: CheckInputs) -> CheckResult:
        """Instances that are the very objects of the check before keep what it found.

        A test is checked again, too, if another one took or gave up its name.
        """
        former = self._result if self._inputs == inputs else CheckResult()
        known = {id(test.spec): test for test in former.tests}
        new = [spec for spec in specs if id(spec) not in known]
        paths = {spec.path for spec in new}
        fresh = {id(test.spec): test for test in resolve((s for s in specs if s.path in paths), *inputs)}
        tests = tuple(fresh.get(id(spec)) or known[id(spec)] for spec in specs)
        here = {id(spec) for spec in specs}
        gone = [test.spec for key, test in known.items() if key not in here]
        names = {spec.name for spec in (*new, *gone)}
        affected = {spec.path for spec in specs if spec.name in names} | paths | {spec.path for spec in gone}
        at_ends = resolve((corner for corner in corners if corner.path in affected), *inputs)
        again = {**former.problems, **check(tests, *inputs, at_ends, affected)}
        self._inputs, self._result = inputs, CheckResult(tests, {spec.path: again[spec.path] for spec in specs})
        return self._result


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
    """The projects of the open tests and deployments; what a change cannot affect is not checked again."""

    def __init__(self, texts: Texts | None = None) -> None:
        self._texts = texts or Texts()
        self._sources: dict[Path, ChangedSources] = {}
        self._is_outdated = False

    def forget(self) -> None:
        """Anything may have changed: manifests, maps, messages. The next check looks at all of it."""
        self._is_outdated = True

    def check(self, shown: Mapping[Path, str]) -> list[Checked]:
        """The projects, checked with the texts that are shown, by resolved path."""
        if self._is_outdated:
            self._is_outdated = False
            self._sources.clear()
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
        sources = self._sources.setdefault(key, ChangedSources(key.parent, self._texts))
        return without_unsatisfied(load(paths, sources=sources), specs)


def by_file(found: Iterable[Diagnostic]) -> Mapping[Path, list[Diagnostic]]:
    """Problems by the resolved path of their file."""
    grouped: dict[Path, list[Diagnostic]] = {}
    for diagnostic in found:
        grouped.setdefault(Path(diagnostic.span.file).resolve(), []).append(diagnostic)
    return grouped
