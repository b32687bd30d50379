"""The tests around the open files: which belong together, and what is wrong with them."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.check import forget_files
from dodo_dsl.compiler import Checked, load, plan, without_unsatisfied
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.texts import ChangedSources, Texts
from dodo_dsl.spec.deployment.deployment import FILE_NAME, find_deployment, load_deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.registry import SUFFIX

_OUTPUT = "generated"


class _Outdated(Exception):
    """The texts have changed since."""


@dataclass(frozen=True)
class Project:
    """The tests of one ``dodo.yml``, or one test outside all; ``folder`` is where it was looked for."""

    folder: Path
    checked: Checked

    def planned(self, is_outdated: Callable[[], bool] = lambda: False) -> list[Diagnostic]:
        """What only shows where all tests are planned together; nothing while there are errors, or no application.

        As soon as it ``is_outdated`` it ends, with nothing: many tests take seconds, and the next check would wait.
        """
        if not self.checked.ok or self.checked.application is None or not self.checked.specs:
            return []

        def before_each() -> None:
            if is_outdated():
                raise _Outdated

        try:
            return list(plan(self.checked, self.folder / _OUTPUT, before_each=before_each).problems)
        except _Outdated:
            return []


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

    def check(self, shown: Mapping[Path, str]) -> list[Project]:
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

    def _project(self, key: Path, files: list[Path]) -> Project:
        specs = [file for file in files if file.name.endswith(SUFFIX)]
        paths = specs
        if key.name == FILE_NAME:
            registry = load_deployment(key, self._texts)[0].registry
            outside = [file for file in specs if not any(file.is_relative_to(folder) for folder in registry)]
            paths = [*registry, *outside] if outside else []
        sources = self._sources.setdefault(key, ChangedSources(key.parent, self._texts))
        return Project(key.parent, without_unsatisfied(load(paths, sources=sources), specs))


def by_file(found: Iterable[Diagnostic]) -> Mapping[Path, list[Diagnostic]]:
    """Problems by the resolved path of their file."""
    grouped: dict[Path, list[Diagnostic]] = {}
    for diagnostic in found:
        grouped.setdefault(Path(diagnostic.span.file).resolve(), []).append(diagnostic)
    return grouped
