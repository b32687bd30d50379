"""What no application sees: the repository's tests, their output and ``.git``."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl.application.construction import Construction, Setting
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.deployment import Deployment

_OUTPUT = ("generated", "dodo-report")


def unseen_folders(application: ApplicationSource, deployment: Deployment) -> list[Path]:
    """What no application sees: folders with tests and own services, ``.git``, compiled tests and reports by default.

    A registry that is the application's own folder, or above it, is none of them.
    """
    own = application.folder.resolve()
    found = {Path(os.path.realpath(folder)) for folder in (*deployment.registry, *deployment.services)}
    roots = {Path(os.path.realpath(root)) for root in (*application.paths.roots, deployment.root, own)}
    made = {root / name for root in roots for name in (".git", *_OUTPUT)}
    return sorted({path for path in found if not own.is_relative_to(path)} | made)


def below(application: ApplicationSource, deployment: Deployment) -> tuple[str, ...]:
    """Folders with tests, maps and truths within the application's own folder, relative to it."""
    own = application.folder.resolve()
    found = {folder.resolve() for folder in (*deployment.registry, *deployment.services)}
    return tuple(sorted(path.relative_to(own).as_posix() for path in found if path != own and path.is_relative_to(own)))


def read_by_tests(application: ApplicationSource, deployment: Deployment, files: Iterable[Path]) -> list[str]:
    """The files, as far as they lie in a registry that holds the application's folder, relative to that."""
    own = application.folder.resolve()
    around = [folder for folder in map(Path.resolve, deployment.registry) if own.is_relative_to(folder)]
    inside = {path for path in files if any(map(path.is_relative_to, around))} if around else ()
    return sorted(Path(os.path.relpath(path, own)).as_posix() for path in inside)


def unseen_problems(application: ApplicationSource, deployment: Deployment) -> Iterator[Diagnostic]:
    """Mounts, configs, secrets, files of variables and builds' contexts in a folder that no application sees."""
    hidden = unseen_folders(application, deployment)
    construction = Construction(application, Setting(1, "network", application.folder, limits=application.limits))
    for service in application.services.values():
        construction.service(service)
    construction.rest()
    for source, span, _ in construction.shown:
        if application.paths.is_writable(source):
            continue
        names = map(Path, application.paths.names(source))
        if holder := next((h for name in names for h in hidden if name.is_relative_to(h)), None):
            what = f"'{holder.name}', {_reason(holder)}"
            message = f"'{source}' lies in {what}, which no application sees"
            yield Diagnostic(span, "application-isolation", message, "keep what it needs in another folder")


def _reason(holder: Path) -> str:
    reasons = {".git": "where Git keeps its own", "generated": "the compiled tests", "dodo-report": "the report"}
    return reasons.get(holder.name, "a folder of tests or of DoDo's services")
