"""What of the repository no application sees: its tests, their output and ``.git``."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl.application.access.model import place
from dodo_dsl.application.access.value_findings import is_remote
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.mounts import shown_paths
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping, Scalar
from dodo_dsl.spec.deployment.deployment import Deployment

_OUTPUT = ("generated", "dodo-report")


def folders(application: ApplicationSource, deployment: Deployment) -> list[Path]:
    """The folders with tests and own services, ``.git``, and where compiled tests and reports are by default.

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
    """Mounts, configs, secrets, files of variables and builds' contexts that lie in such a folder."""
    hidden = folders(application, deployment)
    for source, span in _asked_for(application):
        if application.paths.is_open(source) or application.paths.is_writable(source):
            continue
        names = map(Path, application.paths.names(source))
        if holder := next((h for name in names for h in hidden if name.is_relative_to(h)), None):
            what = f"'{holder.name}', {_reason(holder)}"
            message = f"'{source}' lies in {what}, which no application sees"
            yield Diagnostic(span, "application-isolation", message, "keep what it needs in another folder")


def _reason(holder: Path) -> str:
    reasons = {".git": "where Git keeps its own", "generated": "the compiled tests", "dodo-report": "the report"}
    return reasons.get(holder.name, "a folder of tests or of DoDo's services")


def _asked_for(application: ApplicationSource) -> Iterator[tuple[str, Span]]:
    for shown in shown_paths(application):
        yield shown.source, place(shown.node, shown.steps, shown.span)
    for service in application.services.values():
        yield from ((file.path, file.span) for file in service.env_files)
        build = service.node.get("build")
        context = build.get("context") if isinstance(build, Mapping) else build
        text = context.value if isinstance(context, Scalar) else None
        if context and isinstance(text, str) and not is_remote(text, application.paths):
            yield text, context.span
