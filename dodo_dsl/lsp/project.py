"""The tests around the open files: which belong together, and what is wrong with them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.check import context
from dodo_dsl.check.rules import references
from dodo_dsl.compiler import Checked, load, plan, without_unsatisfied
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.texts import Texts
from dodo_dsl.spec.deployment.deployment import FILE_NAME, find_deployment, load_deployment
from dodo_dsl.spec.manifest import load_manifests
from dodo_dsl.spec.registry import SUFFIX

_OUTPUT = "generated"


@dataclass(frozen=True)
class Project:
    """The tests of one ``dodo.yml``, or one test outside all; ``folder`` is where it was looked for."""

    folder: Path
    checked: Checked

    def planned(self) -> list[Diagnostic]:
        """What only shows where all tests are planned together; nothing while there are errors, or no application."""
        if not self.checked.ok or self.checked.application is None or not self.checked.specs:
            return []
        return list(plan(self.checked, self.folder / _OUTPUT).problems)


def is_ours(path: Path) -> bool:
    """Whether a file is a test or a deployment."""
    return path.name == FILE_NAME or path.name.endswith(SUFFIX)


def projects(files: Iterable[Path], texts: Texts) -> list[Project]:
    """The projects of tests and deployments that are open, checked."""
    groups: dict[Path, list[Path]] = {}
    for file in sorted(files):
        deployment = find_deployment(file.parent)
        groups.setdefault(deployment or file, []).append(file)
    return [_project(key, group, texts) for key, group in groups.items()]


def _project(key: Path, files: list[Path], texts: Texts) -> Project:
    specs = [file for file in files if file.name.endswith(SUFFIX)]
    paths = specs
    if key.name == FILE_NAME:
        registry = load_deployment(key, texts)[0].registry
        outside = [file for file in specs if not any(file.is_relative_to(folder) for folder in registry)]
        paths = [*registry, *outside] if outside else []
    checked = load(paths, start=key.parent, reader=texts)
    return Project(key.parent, without_unsatisfied(checked, specs))


def forget() -> None:
    """Files other than tests may have changed: manifests, maps, messages."""
    load_manifests.cache_clear()
    references.entries.cache_clear()
    context.known_messages.cache_clear()


def by_file(found: Iterable[Diagnostic]) -> Mapping[Path, list[Diagnostic]]:
    """Problems by the resolved path of their file."""
    grouped: dict[Path, list[Diagnostic]] = {}
    for diagnostic in found:
        grouped.setdefault(Path(diagnostic.span.file).resolve(), []).append(diagnostic)
    return grouped
